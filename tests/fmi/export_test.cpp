// Systems as FMUs, run by the import: the events of the system itself.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/faults/fault_system.hpp"
#include "ricochet/fmi/ready.hpp"
#include "ricochet/fmi/run.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/rosenbrock.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"

namespace ricochet::fmi::export_test {

namespace {

using Result = fmi::Run;  // a test has a function Run

Fmu exported(const std::string& name, int version)
{
    const std::string ending = version == 2 ? "-2.fmu" : ".fmu";
    return Fmu(std::filesystem::path(RICOCHET_FMUS) / ("fmu_" + name + ending));
}

/// A ready system, by the library that has all of them.
Fmu ready(std::string_view system, int version)
{
    const std::filesystem::path file = std::filesystem::temp_directory_path() /
                                       ("ricochet_export_" + std::to_string(getpid()) + ".fmu");
    export_ready({.system = system, .version = version}, file);
    const Fmu fmu(file);
    std::filesystem::remove(file);
    return fmu;
}

class Exports : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Fmi, Exports, testing::Values(2, 3));

std::vector<double> times(const Result& run)
{
    std::vector<double> out;
    for (const Event& event : run.events) {
        if (event.causes.state || event.causes.time || event.causes.step) out.push_back(event.t);
    }
    return out;
}

void expect_times(const std::vector<double>& found, const std::vector<double>& expected,
                  double tolerance)
{
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_NEAR(found[i], expected[i], tolerance) << i;
    }
}

TEST_P(Exports, TheBallAsModelExchangeHasItsImpacts)
{
    for (const double rtol : {1e-4, 1e-10}) {
        const Result run = fmi::run(exported("ball", GetParam()), {.t_end = 12,
                                                                   .rtol = rtol,
                                                                   .method = Method::fehlberg78,
                                                                   .output = {"events"},
                                                                   .sample_times = {12}});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        std::vector<double> expected;
        const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
        for (int n = 0; ball.impact_time(n, 10) < 12; ++n)
            expected.push_back(ball.impact_time(n, 10));
        // A quadratic motion: what is left is the location, to a double of 1.8e-15 s at t = 12.
        expect_times(times(run), expected, 4e-15);
        EXPECT_EQ(run.last("events"), static_cast<double>(expected.size()));
    }
}

TEST_P(Exports, TheBallComesToRestInBothInterfaces)
{
    // Its impacts with restitution 0.5 accumulate at 3 times the first fall.
    const double limit = 3 * std::sqrt(2 * 10 / 9.81);
    for (const bool co : {false, true}) {
        const Result run = fmi::run(exported("ball", GetParam()), {.t_end = 6,
                                                                   .start = {{"restitution", 0.5}},
                                                                   .output = {"height", "velocity"},
                                                                   .sample_times = {5.0, 6.0},
                                                                   .co_simulation = co});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        EXPECT_GT(limit, 4);
        EXPECT_EQ(run.last("height"), 0) << co;
        EXPECT_EQ(run.last("velocity"), 0) << co;
    }
}

TEST_P(Exports, CoSimulationOfTheBallDoesNotDependOnTheSteps)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    // Between impacts n and n + 1: the height from the speed after n impacts.
    int n = 0;
    while (ball.impact_time(n + 1, 10) < 12) ++n;
    const double speed = std::sqrt(2 * 9.81 * 10) * std::pow(0.9, n + 1);
    const double after = 12 - ball.impact_time(n, 10);
    const double expected = speed * after - 9.81 / 2 * after * after;
    for (const double step : {0.01, 0.1, 1.0 / 3, 12.0}) {
        const Result run = fmi::run(exported("ball", GetParam()), {.t_end = 12,
                                                                   .output = {"height", "events"},
                                                                   .sample_times = {12},
                                                                   .step = step,
                                                                   .co_simulation = true});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        // The last impact is known to four doubles of a time of 12 s, 1.8e-15 s each, and the ball
        // leaves it at 8.3 m/s.
        EXPECT_NEAR(run.last("height"), expected, 4 * 1.8e-15 * 8.3) << step;
        EXPECT_EQ(run.last("events"), n + 1);
    }
}

/// Times at which the ball passes a height [m], up and down.
std::vector<double> passages(const BouncingBall& ball, double height, double t_end)
{
    std::vector<double> out{std::sqrt(2 * (10 - height) / 9.81)};
    double v = std::sqrt(2 * 9.81 * 10);
    for (int n = 0; ball.impact_time(n, 10) < t_end; ++n) {
        v *= 0.9;
        const double square = v * v - 2 * 9.81 * height;
        if (square < 0) break;
        for (const double side : {-1, 1}) {
            const double t = ball.impact_time(n, 10) + (v + side * std::sqrt(square)) / 9.81;
            if (t <= t_end) out.push_back(t);
        }
    }
    return out;
}

TEST_P(Exports, APassageOfAnOutputIsLocatedInCoSimulation)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    const std::vector<double> expected = passages(ball, 2, 12);
    ASSERT_EQ(expected.size(), 11U);
    for (const double step : {0.01, 0.1, 0.37}) {
        const Result run = fmi::run(exported("ball", GetParam()),
                                    {.t_end = 12,
                                     .output = {"height", "velocity"},
                                     .step = step,
                                     .watch = {{"height", 2}, {"velocity", 0, Crossing::falling}}});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        std::vector<double> found;
        std::size_t tops = 0;
        for (const Event& event : run.events) {
            if (!event.causes.passage) continue;
            if (event.watch == 0) found.push_back(event.t);
            tops += event.watch;
        }
        // To the doubles next to each other, at a speed of 4 m/s and more of a height that is
        // rounded to 4e-16 m; the run inside has its own rounding of a few doubles of the time.
        expect_times(found, expected, 1e-14);
        std::size_t flights = 0;  // whose top is before the end
        double v = 0.9 * std::sqrt(2 * 9.81 * 10);
        while (ball.impact_time(static_cast<int>(flights), 10) + v / 9.81 < 12) {
            ++flights;
            v *= 0.9;
        }
        EXPECT_EQ(tops, flights) << step;
        for (const Row& row : run.rows) {
            if (row.t == found[3]) EXPECT_NEAR(row.values[0], 2, 1e-14);
        }
    }
    // What is watched changes nothing.
    const auto height = [&](std::vector<Watch> watch) {
        return fmi::run(exported("ball", GetParam()), {.t_end = 12,
                                                       .output = {"height"},
                                                       .sample_times = {12},
                                                       .step = 0.1,
                                                       .co_simulation = true,
                                                       .watch = std::move(watch)})
            .last("height");
    };
    EXPECT_EQ(height({}), height({{"height", 2}}));
}

TEST_P(Exports, AWatchThatDoesNotFitIsRefusedByName)
{
    const auto refused = [&](const Options& options) -> std::string {
        try {
            (void)fmi::run(exported("ball", GetParam()), options);
        } catch (const Error& error) {
            return error.what();
        }
        return {};
    };
    EXPECT_NE(refused({.watch = {{"depth", 2}}}).find("'depth'"), std::string::npos);
    EXPECT_NE(refused({.co_simulation = false, .watch = {{"height", 2}}}).find("co-simulation"),
              std::string::npos);
}

TEST(ExportsOfVersion3, CoSimulationShowsTheStateBeforeTheEventUntilItIsHandled)
{
    const Result run =
        fmi::run(exported("ball", 3),
                 {.t_end = 12, .output = {"velocity"}, .step = 0.5, .co_simulation = true});
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    ASSERT_GE(run.events.size(), 3U);
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_NEAR(run.events[i].t, ball.impact_time(static_cast<int>(i), 10), 1e-14);
    }
    for (std::size_t i = 0; i + 1 < run.rows.size(); ++i) {
        if (run.rows[i].place != Row::Place::before_event) continue;
        EXPECT_LT(run.rows[i].values[0], 0);
        EXPECT_NEAR(run.rows[i + 1].values[0], -0.9 * run.rows[i].values[0], 1e-14);
    }
}

TEST_P(Exports, TheThermostatSwitchesWhereItDoesInARunOfItsOwn)
{
    const Thermostat room;
    const Result run = fmi::run(ready("thermostat", GetParam()), {.t_end = 10,
                                                                  .rtol = 1e-12,
                                                                  .method = Method::fehlberg78,
                                                                  .output = {"mode", "temperature"},
                                                                  .sample_times = {10}});
    ASSERT_EQ(run.end, End::reached_end) << describe(run);
    std::vector<double> expected;
    for (int n = 0; room.switch_time(n) < 10; ++n) expected.push_back(room.switch_time(n));
    ASSERT_GE(expected.size(), 3U);
    expect_times(times(run), expected, 1e-10);  // 1e-12 of 22 degrees, at 0.8 degrees a second
    EXPECT_EQ(run.last("mode"), expected.size() % 2 == 1 ? Thermostat::on : Thermostat::off);
}

TEST_P(Exports, TheImpactOscillatorHasTheImpactsOfTheClosedForm)
{
    const std::vector<double> expected = ImpactOscillator().impacts(40);
    ASSERT_GE(expected.size(), 3U);
    const Result run = fmi::run(exported("oscillator", GetParam()), {.t_end = 40,
                                                                     .rtol = 1e-13,
                                                                     .method = Method::fehlberg78,
                                                                     .output = {"energy", "x", "v"},
                                                                     .sample_times = {40}});
    ASSERT_EQ(run.end, End::reached_end) << describe(run);
    expect_times(times(run), expected, 1e-9);
    EXPECT_NEAR(run.last("energy"), (std::pow(run.last("x"), 2) + std::pow(run.last("v"), 2)) / 2,
                1e-15);
}

TEST_P(Exports, TimeEventsAndInputsOfASampledController)
{
    // x' = -x + u + held: from x_k to held + u + (x_k - held - u) e^-h at the next tick.
    const auto closed = [](double t_end, const std::function<double(double)>& u) {
        double x = 1, held = -1;  // the tick at 0
        for (double t = 0; t < t_end - 1e-9; t += 0.5) {
            if (t > 0) held = -x;
            const double limit = held + u(t);
            x = limit + (x - limit) * std::exp(-0.5);
        }
        return x;
    };
    for (const bool co : {false, true}) {
        Options options{.t_end = 3.75 + 0.25,
                        .rtol = 1e-12,
                        .output = {"x"},
                        .sample_times = {4},
                        .step = 0.25,
                        .co_simulation = co};
        const Result constant = fmi::run(exported("sampled", GetParam()), options);
        ASSERT_EQ(constant.end, End::reached_end) << describe(constant);
        EXPECT_NEAR(constant.last("x"), closed(4, [](double) { return 0.5; }), 1e-9) << co;
        options.inputs = {{.name = "u", .t = {0, 2, 2}, .values = {0.5, 0.5, -1}}};
        const Result jump = fmi::run(exported("sampled", GetParam()), options);
        EXPECT_NEAR(jump.last("x"), closed(4, [](double t) { return t < 2 ? 0.5 : -1; }), 1e-9)
            << co;
    }
}

TEST_P(Exports, SimultaneousEventsAndCascadesGiveTheSameCountAsARunOfTheLibrary)
{
    // Both impacts at t = 1 raise the count to 2, which carries the third guard across: 12. The
    // next impacts, at 2, are at the end.
    for (const bool co : {false, true}) {
        const Result run = fmi::run(exported("cascade", GetParam()), {.t_end = 1.9,
                                                                      .output = {"count", "events"},
                                                                      .sample_times = {1.9},
                                                                      .co_simulation = co});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        EXPECT_EQ(run.last("count"), 12) << co;
        EXPECT_EQ(run.last("events"), 3) << co;
    }
}

/// Times of the events of a run of the library that change the state or the mode.
template <class System>
std::vector<double> native(const System& system, const typename System::State& x0, double t_end,
                           Mode mode = 0)
{
    std::vector<double> out;
    const auto run =
        integrate(system, x0, {.t_end = t_end, .mode = mode, .rtol = 1e-10, .atol = 1e-10});
    for (const auto& event : run.events) {
        const bool acts = event.mode_before != event.mode_after || event.before != event.after;
        if (acts && (out.empty() || out.back() != event.t)) out.push_back(event.t);
    }
    return out;
}

TEST(ExportsOfVersion3, ModelsHaveTheEventsOfARunOfTheirOwnAfterARoundTrip)
{
    const auto there = [](const std::string& name, double t_end) {
        return times(
            fmi::run(exported(name, 3), {.t_end = t_end, .step = t_end, .co_simulation = true}));
    };
    // One run of the library inside, with the options above.
    expect_times(there("ball", 12),
                 native(BouncingBall({.gravity = 9.81, .restitution = 0.9}), {10, 0}, 12), 1e-14);
    expect_times(there("oscillator", 40), native(ImpactOscillator(), {0, 0}, 40), 1e-14);
    expect_times(there("stick_slip", 30),
                 native(StickSlip(), StickSlip::start, 30, StickSlip::start_mode), 1e-14);
}

TEST_P(Exports, FrictionAsModelExchangeSticksAndSlipsInTime)
{
    // The closed form of the cycle; dopri5 at 1e-12, whose error of the speed is divided by its
    // rate.
    const Result run = fmi::run(exported("stick_slip", GetParam()), {.t_end = 30,
                                                                     .rtol = 1e-12,
                                                                     .method = Method::fehlberg78,
                                                                     .output = {"mode"},
                                                                     .sample_times = {30}});
    ASSERT_EQ(run.end, End::reached_end) << describe(run);
    const std::vector<double> found = times(run);
    ASSERT_GE(found.size(), 4U);
    EXPECT_NEAR(found[0], StickSlip::stick_time, 1e-9);
    EXPECT_NEAR(found[1], StickSlip::period, 1e-9);
    EXPECT_NEAR(found[2], StickSlip::period + StickSlip::stick_time, 1e-9);
}

TEST_P(Exports, ASetValuedSystemIsForCoSimulation)
{
    const Fmu held = exported("held_ball", GetParam());
    EXPECT_FALSE(held.description().model_exchange);
    for (const double step : {0.01, 2.0}) {
        const Result run =
            fmi::run(held, {.output = {"height", "mode"}, .sample_times = {1.25, 2}, .step = step});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        // It lies on the floor at 1.25 s; lifted with 20 (t - 1.5) from 1.5 s on, it is at
        // 20 * 0.5^3 / 6 at 2 s.
        EXPECT_NEAR(run.last("height"), 20 * 0.125 / 6, 1e-7);
        for (const Row& row : run.rows) {
            if (row.t == 1.25) {
                EXPECT_EQ(row.values[0], 0);
            }
        }
    }
}

TEST_P(Exports, ParametersAreTunedDuringARun)
{
    Simulation simulation(exported("ball", GetParam()), {.t_end = 12});
    ASSERT_TRUE(simulation.advance());  // the first impact
    const double t = simulation.t(), speed = simulation.x()[1];
    simulation.set("gravity", 2 * 9.81);
    ASSERT_TRUE(simulation.advance());
    EXPECT_NEAR(simulation.t(), t + speed / 9.81, 1e-14);
    EXPECT_THROW(simulation.set("height", 1), Error);
}

TEST_P(Exports, AFaultHasTheSlipOfARunOfItsOwn)
{
    const RateStateFaultSystem system(
        StrikeSlipFault({.elements = 2}),
        {.plate_velocity = 1e-3, .slip_rate = 2e-3, .overload = 1e-3});
    const auto own =
        ricochet::integrate(system, system.start(), {.t_end = 30, .rtol = 1e-9, .atol = 1e-9},
                            ErrorControlled<Rosenbrock4>{});
    ASSERT_EQ(own.outcome, Outcome::reached_end);
    const Eigen::VectorXd expected = system.slip(own.t, own.x);
    const std::vector<std::string> slips{"slip[1]", "slip[2]", "slip[3]", "slip[4]"};
    // A step ends at each communication point, which is within the tolerance of the slip; with one
    // communication step the run is the same.
    for (const auto& [step, tolerance] : {std::pair{0.7, 1e-8}, {30.0, 1e-14}}) {
        const Result run = fmi::run(exported("fault", GetParam()), {.t_end = 30,
                                                                    .output = slips,
                                                                    .sample_times = {30},
                                                                    .step = step,
                                                                    .co_simulation = true});
        ASSERT_EQ(run.end, End::reached_end) << describe(run);
        for (Eigen::Index i = 0; i < 4; ++i) {
            const double found = run.rows.back().values[static_cast<std::size_t>(i)];
            EXPECT_NEAR(found, expected[i], tolerance) << step;
            EXPECT_GT(found, 0.02);  // 1 mm/s for 30 s
        }
    }
}

TEST_P(Exports, ASavedRunGoesOnWithTheSameBitsAnyNumberOfTimes)
{
    for (const bool co : {false, true}) {
        const Options options{.t_end = 12,
                              .output = {"height", "velocity"},
                              .sample_times = {1, 5, 11},
                              .step = 0.5,
                              .co_simulation = co};
        Simulation simulation(exported("ball", GetParam()), options);
        for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulation.advance());
        const double t = simulation.t();
        const SavedRun saved = simulation.save();
        const Result first = simulation.finish();
        ASSERT_EQ(first.end, End::reached_end) << describe(first);
        simulation.restore(saved);
        EXPECT_EQ(simulation.t(), t);
        EXPECT_FALSE(simulation.ended());
        simulation.set("gravity", 1);  // another future
        EXPECT_NE(simulation.finish().rows.back().values, first.rows.back().values);
        simulation.restore(saved);
        const Result again = simulation.finish();
        ASSERT_EQ(again.rows.size(), first.rows.size());
        for (std::size_t i = 0; i < again.rows.size(); ++i) {
            EXPECT_EQ(again.rows[i].t, first.rows[i].t);
            EXPECT_EQ(again.rows[i].values, first.rows[i].values) << i;
        }
        ASSERT_EQ(again.events.size(), first.events.size());
        for (std::size_t i = 0; i < again.events.size(); ++i) {
            EXPECT_EQ(again.events[i].t, first.events[i].t);
        }
        // The same as a run that was never saved.
        EXPECT_EQ(fmi::run(exported("ball", GetParam()), options).rows.back().values,
                  first.rows.back().values);
    }
}

TEST_P(Exports, ASavedRunOfASetValuedSystemGoesOnWhileItIsHeld)
{
    Simulation simulation(exported("held_ball", GetParam()),
                          {.t_end = 2, .output = {"height"}, .sample_times = {2}, .step = 0.05});
    while (simulation.t() < 1.2) ASSERT_TRUE(simulation.advance());
    EXPECT_EQ(simulation.get("height"), 0);  // it lies on the floor
    const SavedRun saved = simulation.save();
    const double first = simulation.finish().last("height");
    EXPECT_GT(first, 0.1);
    simulation.restore(saved);
    EXPECT_EQ(simulation.get("height"), 0);
    EXPECT_EQ(simulation.finish().last("height"), first);
}

TEST_P(Exports, ASavedRunIsOfOneSimulationAndMayOutliveIt)
{
    SavedRun saved;
    Simulation other(exported("ball", GetParam()), {.t_end = 12});
    EXPECT_THROW(other.restore(saved), Error);
    {
        Simulation simulation(exported("ball", GetParam()), {.t_end = 12});
        saved = simulation.save();
    }
    try {
        other.restore(saved);
        FAIL() << "not refused";
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("another simulation"), std::string::npos);
    }
}

TEST(ExportedDescription, SaysNamesUnitsAndStarts)
{
    for (const int version : {2, 3}) {
        const Description d = exported("ball", version).description();
        EXPECT_EQ(d.model_name, "Ball & \"floor\"");
        EXPECT_EQ(d.state_names(), (std::vector<std::string>{"height", "velocity"}));
        EXPECT_EQ(d.indicator_count, 1U);
        EXPECT_EQ(d.t_end, 12);
        const Variable& height = d.variables[d.find("height")->variable];
        EXPECT_EQ(height.unit, "m");
        EXPECT_EQ(height.start, std::vector<double>{10});
        EXPECT_EQ(height.description, "above the floor");
        EXPECT_TRUE(d.model_exchange->saves_state && d.co_simulation->variable_steps);
    }
    EXPECT_NE(exported("ball", 3).description().token, exported("cascade", 3).description().token);
}

}  // namespace

}  // namespace ricochet::fmi::export_test
