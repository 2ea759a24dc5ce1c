// Runs of the models in probe.c against closed forms, in both versions. Every model checks the
// legality of each call.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "probes.hpp"
#include "ricochet/fmi/run.hpp"

namespace ricochet::fmi::model_exchange_test {

namespace {

using Result = fmi::Run;  // a test has a function Run
using fmi_test::probe;
using fmi_test::ProbeModel;

const ProbeModel ball{"Ball", 2, 1, true};
const ProbeModel zeno{"Zeno", 2, 1};
const ProbeModel relation{"Relation", 2, 1};
const ProbeModel relay{"Relay", 1, 2};
const ProbeModel restored{"Restored", 1, 1};
const ProbeModel timer{"Timer", 2, 2};
const ProbeModel cascade{"Cascade", 1, 2};
const ProbeModel step_event{"StepEvent", 2, 0, true};
const ProbeModel zero{"Zero", 1, 1};
const ProbeModel discard{"Discard", 1, 1};
const ProbeModel stiff{"Stiff", 1, 0, false, true};
const ProbeModel two{"Two", 2, 2};
const ProbeModel slide{"Slide", 1, 1};
const ProbeModel inputs{"Inputs", 2, 0};
const ProbeModel clock_model{"Clock", 0, 0};
const ProbeModel faulty{"Faulty", 1, 1};
const ProbeModel nominals{"Nominals", 1, 1};
const ProbeModel reactions{"Reactions", 2, 0, false, true};

const std::vector<std::string> watched = {"violations", "count0", "count1",
                                          "count2",     "count3", "q"};

class ModelExchange : public testing::TestWithParam<int> {
protected:
    [[nodiscard]] static int version() { return GetParam(); }

    /// A run that breaks no rule of the standard.
    [[nodiscard]] static Result legal(const ProbeModel& model, Options options = {})
    {
        options.output.insert(options.output.end(), watched.begin(), watched.end());
        options.sample_times.push_back(options.t_end.value_or(3));
        Result out = run(probe(model, version()), options);
        EXPECT_EQ(out.last("violations"), 0) << model.name;
        return out;
    }
    [[nodiscard]] static std::string x(int i) { return "x[" + std::to_string(i) + "]"; }
};

INSTANTIATE_TEST_SUITE_P(Fmi, ModelExchange, testing::Values(2, 3));

/// Impacts of the ball: sqrt(2/g) (1 + 2 (e + e^2 + ...)).
std::vector<double> impacts(double e, double stop)
{
    const long double first = std::sqrt(2.0L / 9.81L);
    std::vector<double> times;
    long double t = first, speed = 9.81L * first, flight = 2 * first;
    for (;;) {
        times.push_back(static_cast<double>(t));
        speed *= e;
        flight *= e;
        if (speed < stop) return times;
        t += flight;
    }
}

TEST_P(ModelExchange, ImpactsOfTheBallAreThoseOfTheClosedFormAtAnyTolerance)
{
    // The motion is a quadratic, which the methods integrate exactly: what is left is the location,
    // to neighbouring doubles, 4.4e-16 s here, and the rounding of eleven flights. dopri5 at 1e-4
    // takes a flight in two steps, whose rounding of 5e-16 in height is energy for the next.
    for (const Method method : {Method::dopri5, Method::fehlberg78}) {
        for (const double rtol : {1e-4, 1e-8, 1e-12}) {
            const Result run = legal(ball, {.rtol = rtol, .method = method, .output = {x(1)}});
            ASSERT_EQ(run.end, End::reached_end) << describe(run);
            const std::vector<double> expected = impacts(0.7, 0.1);
            ASSERT_EQ(run.events.size(), expected.size());
            double worst = 0;
            for (std::size_t i = 0; i < expected.size(); ++i) {
                worst = std::max(worst, std::fabs(run.events[i].t - expected[i]));
                EXPECT_TRUE(run.events[i].causes.state);
                EXPECT_EQ(run.events[i].indicator, 0U);
            }
            RecordProperty("worst_" + std::string(name(method)) + std::to_string(rtol),
                           std::to_string(worst * 1e16));
            EXPECT_LE(worst, method == Method::dopri5 && rtol == 1e-4 ? 2e-15 : 1e-15)
                << name(method) << " " << rtol;
            EXPECT_EQ(run.last("count1"), 1) << "rounds for nothing, beside that of the start";
            EXPECT_EQ(run.last("count0"), static_cast<double>(expected.size()));
        }
    }
}

TEST_P(ModelExchange, ASignOfARelationIsLocatedAtItsThreshold)
{
    const Result run = legal(relation, {.t_end = 1.5, .output = {x(1)}});
    ASSERT_GE(run.events.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) {
        // Falling it changes at -1e-10 m, rising at 1e-10 m; at the speeds here (up to 4.5 m/s) a
        // neighbouring double of the time is up to 1e-15 m away.
        const double threshold = i % 2 == 0 ? -1e-10 : 1e-10;
        EXPECT_NEAR(run.events[i].before[0], threshold, 2e-15) << i;
    }
}

/// Switchings of the thermostat between 18 and 22, heated towards 30, cooled towards 15, from 19.
std::array<double, 5> switchings()
{
    const double up = std::log(12.0 / 8), down = std::log(7.0 / 3), first = std::log(11.0 / 8);
    return {first, first + down, first + down + up, first + 2 * down + up,
            first + 2 * down + 2 * up};
}

TEST_P(ModelExchange, AThermostatWithIndicatorsOfOneAndMinusOneSwitchesInTime)
{
    for (const ProbeModel& model : {relay, restored}) {
        for (const auto& [rtol, error] : {std::pair{1e-6, 1e-5}, {1e-8, 1e-7}, {1e-12, 1e-11}}) {
            const Result run = legal(model, {.rtol = rtol, .output = {x(1)}});
            const auto expected = switchings();
            // A relation above its threshold is below it again at once, which is an event, too.
            const std::size_t of_one = model.name == "Relay" ? 2 : 1;
            ASSERT_EQ(run.events.size(), of_one * expected.size()) << model.name;
            // The error of the temperature, of the order of rtol times its size of 22, over its
            // slowest rate at a switching, 3 a second.
            for (std::size_t i = 0; i < expected.size(); ++i) {
                EXPECT_NEAR(run.events[of_one * i].t, expected[i], error)
                    << model.name << " " << rtol;
            }
            EXPECT_EQ(run.last("count0"), static_cast<double>(expected.size()));
        }
    }
}

TEST_P(ModelExchange, ATimeEventThatAStateEventSchedulesOrCancelsIsMet)
{
    // By hand: halves at 0.5, 1, 1.5, ... (the saw jumps at whole numbers, too), timers at 0.6,
    // 1.6, and that of 2.5 cancelled at 2.55. x2 counts seconds times q: 0.6 to 1.6 once, then
    // twice to 3.
    const Result run = legal(timer, {.output = {x(2)}});
    const std::vector<double> expected = {0.5, 0.6, 1, 1.5, 1.6, 2, 2.5, 2.55, 3};
    ASSERT_GE(run.events.size(), expected.size() - 1);
    for (std::size_t i = 0; i < expected.size() - 1; ++i) {
        EXPECT_NEAR(run.events[i].t, expected[i], 1e-15) << i;
    }
    EXPECT_TRUE(run.events[1].causes.time);
    EXPECT_NEAR(run.last(x(2)), 1 + 2 * 1.4, 1e-14);
    EXPECT_EQ(run.last("count2"), 2);
}

TEST_P(ModelExchange, AnEventOfFiveRoundsIsOneEvent)
{
    // To 1 with rate 1, then five rounds raise it to 6; the other indicator changes meanwhile.
    const Result run = legal(cascade, {.output = {x(1)}});
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_NEAR(run.events[0].t, 1, 1e-15);
    EXPECT_NEAR(run.last(x(1)), 1 + 2 * 6, 1e-14);
}

TEST_P(ModelExchange, ACompletedStepMayAskForEventMode)
{
    // The pendulum from 1 rad at rest: the angle is q + x1 throughout. The reference is a run with
    // rtol 1e-12 without charts, integrated here by the same method from the other end: energy.
    const Result run = legal(step_event, {.rtol = 1e-10, .output = {x(1), x(2)}});
    ASSERT_GE(run.events.size(), 1U);
    for (const Event& event : run.events) EXPECT_TRUE(event.causes.step);
    const double angle = run.last(x(1)) + run.last("q"), speed = run.last(x(2));
    EXPECT_NEAR(speed * speed / 2 - std::cos(angle), -std::cos(1.0), 1e-9);
    EXPECT_GT(std::fabs(speed), 0.01);
}

TEST_P(ModelExchange, AnIndicatorThatStartsAtZeroAndRisesIsAnEvent)
{
    const Result run = legal(zero, {.output = {x(1)}});
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_GE(run.events[0].t, 0);
    EXPECT_LT(run.events[0].t, 1e-300);
}

TEST_P(ModelExchange, AFlowThatEndsStillDeliversTheEventBefore)
{
    // x = (1 - t/2)^2: 0.01 at t = 1.8, and the flow ends at 2.
    const Result run = legal(discard, {.output = {x(1)}});
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_NEAR(run.events[0].t, 1.8, 1e-7);  // rtol of 1 over some steps, over the rate of 0.1
    EXPECT_EQ(run.end, End::not_integrated);
    EXPECT_NEAR(run.t, 2, 1e-3);
}

TEST_P(ModelExchange, DirectionalDerivativesAreUsedForStiffMotion)
{
    const Result run = legal(stiff, {.output = {x(1)}});
    EXPECT_EQ(run.method, Method::rosenbrock4);
    EXPECT_TRUE(run.warnings.empty());
    EXPECT_LT(run.steps, 1000U);
    // x = (L^2 cos t + L sin t)/(L^2 + 1) after the transient, with L = 1e6.
    const double L = 1e6;
    const double expected = (L * L * std::cos(3.0) + L * std::sin(3.0)) / (L * L + 1);
    EXPECT_NEAR(run.last(x(1)), expected, 1e-7);
    EXPECT_GT(run.calls.directional, 0U);
}

TEST_P(ModelExchange, WrongDirectionalDerivativesAreFoundAndNotUsed)
{
    const Result run = legal(reactions, {.t_end = 40, .rtol = 1e-6, .output = {x(1)}});
    ASSERT_EQ(run.warnings.size(), 1U);
    EXPECT_NE(run.warnings[0].find("der(x[1])"), std::string::npos) << run.warnings[0];
    const Result stiff_run = legal(
        reactions, {.t_end = 40, .rtol = 1e-8, .method = Method::rosenbrock4, .output = {x(1)}});
    EXPECT_LT(stiff_run.steps, 400U);
    // 0.7158270687 at t = 40 (Hairer and Wanner, Solving Ordinary Differential Equations II).
    EXPECT_NEAR(stiff_run.last(x(1)), 0.7158270687, 1e-6);
}

TEST_P(ModelExchange, AResetThatCarriesAnotherIndicatorAcrossIsNoEventOfThat)
{
    // The first falls from 1 to 0 at t = 1 and is put back to 1, the second is thrown below; the
    // FMU has settled that itself: events at 1, 2 and 3.
    const Result run = legal(two, {.t_end = 2.5, .output = {x(1)}});
    ASSERT_EQ(run.events.size(), 2U);
    EXPECT_EQ(run.last("count2"), 0);
}

TEST_P(ModelExchange, EndlessBouncingEndsWithTheIndicatorThatChatters)
{
    const Result run = legal(zeno, {.output = {x(1)}});
    EXPECT_EQ(run.end, End::chattering);
    EXPECT_EQ(run.indicator, 0U);
    EXPECT_NE(run.message.find("indicator 1"), std::string::npos);
    if (version() == 3) {
        EXPECT_NE(run.message.find("z1"), std::string::npos);
    }
    // The limit of the impacts, sqrt(2/g) (1 + e)/(1 - e).
    EXPECT_NEAR(run.t, std::sqrt(2 / 9.81) * 1.7 / 0.3, 1e-13);

    const Result stuck = legal(zeno, {.start = {{"p1", 0.0}}, .output = {x(1)}});
    EXPECT_EQ(stuck.end, End::chattering);
    EXPECT_NEAR(stuck.t, std::sqrt(2 / 9.81), 1e-15);
}

TEST_P(ModelExchange, SlidingAlongAFrozenRelationIsChattering)
{
    const Result run = legal(slide, {.output = {x(1)}});
    EXPECT_EQ(run.end, End::chattering);
    EXPECT_NEAR(run.t, 1, 1e-9);  // a thousand events within a billionth of the span
}

TEST_P(ModelExchange, InputsAreTablesAndFunctions)
{
    // u: 0 to 1 over the first second, a jump to 3 at 2; its integral is 1/2 + 1 + 3. d: 1 from
    // 0.5, 2 from 1.5; its integral to 3 is 1 + 3.
    Options options{.output = {x(1), x(2)}};
    options.inputs = {{.name = "u", .t = {0, 1, 2, 2}, .values = {0, 1, 1, 3}},
                      {.name = "d", .t = {0, 0.5, 1.5}, .values = {0, 1, 2}}};
    const Result run = legal(inputs, options);
    EXPECT_EQ(run.end, End::reached_end) << describe(run);
    EXPECT_NEAR(run.last(x(1)), 4.5, 1e-14);
    EXPECT_NEAR(run.last(x(2)), 4, 1e-14);
    ASSERT_EQ(run.events.size(), 3U);
    EXPECT_EQ(run.events[0].t, 0.5);
    EXPECT_EQ(run.events[1].t, 1.5);
    EXPECT_EQ(run.events[2].t, 2);
    for (const Event& event : run.events) EXPECT_TRUE(event.causes.input);

    Options smooth{.rtol = 1e-12, .output = {x(1)}};
    smooth.inputs = {
        {.name = "u", .t = {}, .values = {}, .function = [](double t) { return std::cos(t); }}};
    EXPECT_NEAR(legal(inputs, smooth).last(x(1)), std::sin(3.0), 1e-11);
}

TEST_P(ModelExchange, AnInputAndATimeEventAtOneInstantAreOneEvent)
{
    Options options{.t_end = 2.5};
    options.inputs = {{.name = "d", .t = {0, 1}, .values = {0, 1}}};
    const Result run = legal(clock_model, options);
    ASSERT_EQ(run.events.size(), 2U);
    EXPECT_TRUE(run.events[0].causes.time && run.events[0].causes.input);
    EXPECT_EQ(run.last("q"), 2);
    EXPECT_TRUE(run.x.empty());
}

TEST_P(ModelExchange, WhatAnFmuReturnsEndsTheRunWithWhatThereIs)
{
    const double half = std::log(2.0);
    const auto ends = [&](double how) {
        const Result out = run(probe(faulty, version()), {.start = {{"p0", how}}});
        EXPECT_NEAR(out.t, how == 5 ? half : half, 1e-7) << how;
        EXPECT_FALSE(describe(out).empty());
        return out.end;
    };
    EXPECT_EQ(ends(1), End::call_failed);     // endless rounds
    EXPECT_EQ(ends(2), End::terminated);      // asks for the end
    EXPECT_EQ(ends(3), End::call_failed);     // an error
    EXPECT_EQ(ends(4), End::call_failed);     // a fatal one
    EXPECT_EQ(ends(5), End::not_integrated);  // NaN from there on
}

TEST_P(ModelExchange, NominalValuesAreReadAfterInitializationAndAgainWhereTheyChange)
{
    const Result run = legal(nominals, {.output = {x(1)}});
    ASSERT_EQ(run.warnings.size(), 1U);  // 0 at the start
    EXPECT_NE(run.warnings[0].find("nominal"), std::string::npos);
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_NEAR(run.last(x(1)), std::exp(-3.0), 1e-8);
}

TEST_P(ModelExchange, RowsHoldSamplesAndBothSidesOfEvents)
{
    const Result run = fmi::run(probe(ball, version()),
                                {.output = {x(1), x(2)}, .sample_times = {0, 0.25, 0.5, 3}});
    ASSERT_GE(run.rows.size(), 4U + 2 * run.events.size());
    double before = 0;
    std::size_t sides = 0;
    for (const Row& row : run.rows) {
        EXPECT_GE(row.t, before);
        before = row.t;
        sides += row.place != Row::Place::sample;
        if (row.t == 0.25) {
            EXPECT_NEAR(row.values[0], 1 - 9.81 / 2 / 16, 1e-15);
        }
    }
    EXPECT_EQ(sides, 2 * run.events.size());
    EXPECT_EQ(run.rows.front().t, 0);
    EXPECT_EQ(run.rows.back().t, 3);
}

TEST_P(ModelExchange, ASimulationIsDrivenFromEventToEvent)
{
    Simulation simulation(probe(ball, version()), {});
    ASSERT_TRUE(simulation.advance());
    EXPECT_NEAR(simulation.t(), std::sqrt(2 / 9.81), 1e-15);
    EXPECT_GT(simulation.x()[1], 0);
    simulation.set("p0", 2 * 9.81);  // twice the gravity: half the flight
    ASSERT_TRUE(simulation.advance());
    EXPECT_NEAR(simulation.t(), std::sqrt(2 / 9.81) * (1 + 0.7), 1e-15);
    EXPECT_THROW(simulation.set("x[1]", 1), Error);
    EXPECT_EQ(simulation.get("violations"), 0);
    EXPECT_THROW((void)simulation.save(), Error);  // which it does not offer
    EXPECT_EQ(simulation.finish().end, End::reached_end);
}

TEST(ModelExchangeVersions, BothGiveTheSameBits)
{
    const Result second = run(probe(ball, 2)), third = run(probe(ball, 3));
    ASSERT_EQ(second.events.size(), third.events.size());
    for (std::size_t i = 0; i < second.events.size(); ++i) {
        EXPECT_EQ(second.events[i].t, third.events[i].t);
        EXPECT_EQ(second.events[i].after, third.events[i].after);
    }
}

}  // namespace

}  // namespace ricochet::fmi::model_exchange_test
