// Networks that are evaluated only while that pays.
#include "ricochet/gates.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "clearing_gate.hpp"
#include "core/cost_comparison.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/learn/certify.hpp"

namespace ricochet::meter_test {
namespace {

using Fixed = FixedStep<Rk4>;
using Decision = MeterOptions::Decision;
using X = std::array<double, 2>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

/// A point that goes back and forth between two walls at -1 and 1.
struct Shuttle {
    using State = X;
    static constexpr std::string_view name = "shuttle";
    double loose = 1;  ///< factor of the bound relative to the exact value

    template <class V>
    void flow(double, const V& x, V& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = 0;
    }
    template <class V>
    double guard(double, const V& x) const
    {
        return 1 - std::fabs(x[0]);
    }
    template <class V, class D>
    double guard_rate(double, const V& x, const D& dxdt) const
    {
        return x[0] > 0 ? -dxdt[0] : dxdt[0];
    }
    template <class V>
    void reset(double, V& x) const
    {
        x[1] = -x[1];
    }
    template <class V>
    double speed_bound(double, const V& x) const
    {
        return loose * std::fabs(x[1]);
    }
    template <class V>
    double guard_slack(const V& half_widths) const
    {
        return half_widths[0] + 1e-15;
    }
};

struct Other : Shuttle {
    static constexpr std::string_view name = "other";
};

constexpr X at_centre{0, 1};

Model shuttle_model()
{
    Model model;
    model.system = "shuttle";
    model.recipe = "state";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.domain = {{-1, 1}, {-2, 2}};
    model.step_min = model.step_max = 0.001;
    model.precision = Precision::f64;
    return model;
}

/// Predicts in every state that no event occurs for so long, or never does so (threshold -1).
gates::Gate horizon_gate(double horizon, double threshold = 1)
{
    Model model = shuttle_model();
    model.kind = "gate-horizon";
    model.layers = {{2, 2, {0, 0, 0, 0}, {0, 0}}, {2, 1, {0, 0}, {0}}};
    model.levels = {{.value = horizon, .threshold = threshold}};
    return gates::Gate(model);
}

/// logit |x|, with the margins that have been proved.
Model certified_model(std::vector<double> margins)
{
    Model model = shuttle_model();
    model.layers = {{2, 2, {1, 0, -1, 0}, {0, 0}}, {2, 1, {1, 1}, {0}}};
    model.threshold = 1 - margins.front() - 1e-6;
    learn::CertifyOptions options{.margin = margins.front(), .levels = margins.size()};
    options.ratio = margins.size() > 1 ? margins[1] / margins[0] : 2;
    const auto certified =
        learn::certify(model, learn::guard_problem(Shuttle{}, model, at_centre), options);
    EXPECT_TRUE(certified.proved()) << learn::describe(certified.report.outcome);
    return certified.model;
}

struct MeteredRun {
    ricochet::Run<X> run;
    MeterReading meter;
};

template <class Stepping = Fixed, class Detector>
MeteredRun run_with(const Shuttle& system, const Options& options, const Detector& detector)
{
    Simulation simulation(system, at_centre, options, Stepping{}, detector);
    while (simulation.advance()) {
    }
    const MeterReading meter = simulation.meter();
    return {simulation.finish(), meter};
}

template <class RunA, class RunB>
void expect_same(const RunA& a, const RunB& b)
{
    ASSERT_EQ(a.events.size(), b.events.size());
    for (std::size_t k = 0; k < a.events.size(); ++k) {
        ASSERT_EQ(a.events[k].t, b.events[k].t) << k;
        ASSERT_EQ(a.events[k].after, b.events[k].after) << k;
    }
    EXPECT_EQ(a.outcome, b.outcome);
    EXPECT_EQ(a.x, b.x);
    EXPECT_EQ(a.statistics.steps, b.statistics.steps);
}

const Options fifty_seconds{.t_end = 50, .step = 0.001};
const PlannerOptions unchecked{.check_bounds = false};

MeterOptions counted(double guard, double network)
{
    return {.decision = Decision::counted, .guard = guard, .network = network, .step = 1e-7};
}

static_assert(KeepsEvents<Foreseen<>> && KeepsEvents<Verified<>> && KeepsEvents<Certified<>>);
static_assert(!KeepsEvents<Calibrated<>> && !KeepsEvents<CalibratedBounds<>>);
static_assert(!KeepsEvents<Planned<>> && !KeepsEvents<BareNetwork>);

TEST(Metered, AskingIsStoppedWhereItDoesNotPay)
{
    const auto planned =
        integrate(Shuttle{}, at_centre, fifty_seconds, Fixed{}, Planned(unchecked));
    const Foreseen never_clears(horizon_gate(0.1, -1), unchecked);
    const auto always =
        run_with(Shuttle{}, fifty_seconds, Metered(never_clears, {.decision = Decision::always}));
    // A network of 1 us before a guard of 1 us.
    const auto metered =
        run_with(Shuttle{}, fifty_seconds, Metered(never_clears, counted(1e-6, 1e-6)));
    expect_same(planned, metered.run);
    expect_same(planned, always.run);
    EXPECT_FALSE(metered.meter.pays);
    EXPECT_EQ(metered.meter.cleared, 0U);
    EXPECT_GT(metered.meter.asked, 0U);
    // At most 1 % of the run, and the first few.
    const Statistics& s = metered.run.statistics;
    const double total = 1e-7 * static_cast<double>(s.steps) +
                         1e-6 * static_cast<double>(s.guard_calls + s.network_calls);
    EXPECT_LT(1e-6 * static_cast<double>(s.network_calls), 0.02 * total + 32e-6);
    EXPECT_LT(4 * s.network_calls, always.run.statistics.network_calls);
    EXPECT_EQ(metered.meter.asked, s.network_calls);
}

TEST(Metered, AHostileNetworkIsFoundOutByTheStepsItTakesBack)
{
    // Twenty steps farther than any interval can be closed, with a guard and a network at no cost.
    const Foreseen bold(horizon_gate(0.25), unchecked);
    Shuttle loose{.loose = 4};
    const auto planned = integrate(loose, at_centre, fifty_seconds, Fixed{}, Planned(unchecked));
    const auto always =
        run_with(loose, fifty_seconds, Metered(bold, {.decision = Decision::always}));
    const auto metered = run_with(loose, fifty_seconds, Metered(bold, counted(1e-7, 1e-8)));
    expect_same(planned, metered.run);
    expect_same(planned, always.run);
    EXPECT_GT(always.run.statistics.repeated_steps, planned.statistics.repeated_steps);
    EXPECT_FALSE(metered.meter.pays);
    const auto work = [](const Statistics& s) {
        return 1e-7 * static_cast<double>(s.steps + s.repeated_steps + s.guard_calls) +
               1e-8 * static_cast<double>(s.network_calls);
    };
    EXPECT_GT(work(always.run.statistics), 1.1 * work(planned.statistics));
    EXPECT_LT(work(metered.run.statistics), 1.05 * work(planned.statistics));
}

TEST(Metered, GoesOnAskingWhatPays)
{
    // Under a bound that is twenty times too large planning alone saves little; the certificate
    // says that the middle is far from both walls.
    const Shuttle loose{.loose = 20};
    const Model model = certified_model({0.1, 0.2, 0.4});
    const Certified certified(model, unchecked);
    const auto planned = integrate(loose, at_centre, fifty_seconds, Fixed{}, Planned(unchecked));
    const auto metered = run_with(loose, fifty_seconds, Metered(certified, counted(1e-4, 1e-7)));
    expect_same(planned, metered.run);
    EXPECT_TRUE(metered.meter.pays);
    EXPECT_LT(metered.meter.asking, metered.meter.not_asking);
    EXPECT_GT(metered.meter.share_cleared(), 0.5);
    // Either way a step that the loose bound leaves open is divided until it is closed, which takes
    // most of the calls.
    EXPECT_LT(metered.run.statistics.guard_calls, planned.statistics.guard_calls);
}

template <class Stepping>
void expect_same_events_while_ways_change(const Shuttle& system, const Options& options)
{
    const Foreseen gated(horizon_gate(0.05), unchecked);
    const auto exact = integrate(system, at_centre, options, Stepping{});
    ASSERT_GT(exact.statistics.events, 20U);
    const auto checked =
        run_with<Stepping>(system, options, Metered(gated, {.decision = Decision::every_step}));
    expect_same(exact, checked.run);
    EXPECT_EQ(checked.run.statistics.network_calls, 0U);
    EXPECT_EQ(checked.run.statistics.checks_deferred, 0U);
    EXPECT_GE(checked.run.statistics.guard_calls, exact.statistics.steps);
    // With free checks and all the time available for trials, the meter switches continually.
    MeterOptions restless = counted(0, 0);
    restless.trials = 1;
    for (const std::uint64_t piece : {1U, 7U, 50U}) {
        restless.piece = piece;
        const auto changing = run_with<Stepping>(system, options, Metered(gated, restless));
        expect_same(exact, changing.run);
        EXPECT_GT(changing.meter.checking, 0) << piece;
        EXPECT_GT(changing.run.statistics.checks_deferred, 0U) << piece;
    }
}

TEST(Metered, EventsStayTheSameWhereEveryStepIsCheckedForAWhile)
{
    // With a bound four times too large, intervals are rolled back.
    expect_same_events_while_ways_change<Fixed>(Shuttle{.loose = 4}, fifty_seconds);
    expect_same_events_while_ways_change<ErrorControlled<Dopri5>>(
        Shuttle{.loose = 4}, {.t_end = 50, .rtol = 1e-9, .atol = 1e-9, .h_max = 0.02});
}

TEST(Metered, ImpactsThatTakeAllSpeedAreThoseOfTheExactDetector)
{
    const test::PlasticOscillator system;
    const Options options{.t_end = 20, .step = 0.001};
    const auto exact = integrate(system, X{1, 0}, options, Fixed{});
    EXPECT_EQ(exact.events.size(), 3U);
    for (const Decision decision : {Decision::every_step, Decision::always}) {
        const Metered metered(Foreseen<>(test::clearing_gate(0.1), unchecked),
                              {.decision = decision});
        expect_same(exact, integrate(system, X{1, 0}, options, Fixed{}, metered));
    }
}

/// A pendulum beside a wall, with bounds so loose that steps may as well all be checked.
struct LooseBounds {
    using State = X;
    static constexpr std::string_view name = "shuttle";
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -std::sin(x[0])}; }
    double guard(double, const X& x) const { return x[0] + 0.5; }
    void reset(double, X& x) const { x = {-0.5, -0.95 * x[1]}; }
    double speed_bound(double, const X& x) const { return 20 * std::fabs(x[1]); }
    double acceleration_bound(double, const X&) const { return 20; }
};

// Snapshots of planned steps are restored where every step is checked, and the other way round.
TEST(Metered, ASnapshotIsRestoredWhetherOrNotEveryStepIsChecked)
{
    const LooseBounds system;
    const Options options{.t_end = 60, .rtol = 1e-6, .atol = 1e-6};
    for (const std::uint64_t piece : {2U, 5U, 8U}) {
        MeterOptions restless = counted(0, 0);
        restless.trials = 1;
        restless.piece = piece;
        const Metered detector(Foreseen(horizon_gate(0.05), unchecked), restless);
        const auto after = [&](int steps) {
            Simulation simulation(system, X{1, 0}, options, ErrorControlled<Dopri5>{}, detector);
            for (int k = 0; k < steps; ++k) simulation.step();
            return simulation;
        };
        const auto whole = after(0).take();
        ASSERT_EQ(whole.events.size(), 13U);
        for (int saved = 1; saved < 60; ++saved) {
            auto first = after(saved);
            const Snapshot snapshot = first.save();
            for (int steps = 0; steps < 60; steps += 3) {
                auto second = after(steps);
                const std::size_t own = second.run().events.size();
                const std::size_t past = first.run().events.size();
                second.restore(snapshot);
                const auto run = second.take();
                ASSERT_EQ(run.events.size() - own, 13U - past) << piece << ' ' << saved;
                for (std::size_t k = past; k < 13; ++k) {
                    ASSERT_EQ(run.events[own + k - past].t, whole.events[k].t);
                    ASSERT_EQ(run.events[own + k - past].before, whole.events[k].before);
                }
                ASSERT_EQ(run.x, whole.x);
            }
        }
    }
}

TEST(Metered, ASnapshotIsRestoredAfterAWrongBound)
{
    Shuttle system{.loose = 0.5};
    using Planning = Simulation<Shuttle, X, Fixed, Planned<>>;
    Planning simulation(system, at_centre, {.t_end = 6, .step = 0.001});
    const Snapshot start = simulation.save();
    simulation.run_to_end([](const Event<X>&) {});
    ASSERT_EQ(simulation.run().outcome, Outcome::wrong_bound);
    system.loose = 1;
    simulation.restore(start);
    const auto run = simulation.take();
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.guard, no_guard);
    EXPECT_FALSE(run.wrong_bound);
    EXPECT_EQ(run.events.size(), 3u);
}

TEST(Metered, PlanningIsLeftWhereItCostsMoreThanItSaves)
{
    const MeterOptions options = counted(1e-7, 1e-6);
    // Calls of the guard per step: one if every step is checked; ten, or a tenth, if planned.
    for (const double planned : {10.0, 0.1}) {
        detail::CostComparison meter(options, 1);
        Statistics counts;
        double calls = 0;
        std::uint64_t checked = 0;
        for (; counts.steps < 100 * options.piece; ++counts.steps) {
            calls += meter.checks() ? 1 : planned;
            checked += meter.checks() ? 1 : 0;
            counts.guard_calls = static_cast<std::uint64_t>(calls);
            meter.review(counts);
        }
        EXPECT_EQ(meter.reading().checks, planned > 1);
        // Half of the first 8 pieces are planned in any case, and trials are few.
        if (planned > 1) {
            EXPECT_GT(checked, 85 * options.piece);
        } else {
            EXPECT_EQ(checked, 0U);  // a check alone costs more than a planned step
        }
    }
}

TEST(Metered, MeasuresWhatThingsCostAndKeepsTheEvents)
{
    const auto planned =
        integrate(Shuttle{}, at_centre, fifty_seconds, Fixed{}, Planned(unchecked));
    const auto measured =
        run_with(Shuttle{}, fifty_seconds, Metered(Foreseen(horizon_gate(0.05), unchecked)));
    expect_same(planned, measured.run);
    EXPECT_GT(measured.meter.guard, 0);
    EXPECT_GT(measured.meter.network, 0);
    EXPECT_GT(measured.meter.step, 0);
    EXPECT_GT(measured.meter.not_asking, 0);
}

TEST(Metered, CountedCostsMakeARunRepeatable)
{
    const Metered detector(Foreseen(horizon_gate(0.02), unchecked), counted(1e-6, 1e-7));
    const auto first = run_with(Shuttle{}, fifty_seconds, detector);
    const auto second = run_with(Shuttle{}, fifty_seconds, detector);
    expect_same(first.run, second.run);
    EXPECT_EQ(first.run.statistics.network_calls, second.run.statistics.network_calls);
    EXPECT_EQ(first.run.statistics.guard_calls, second.run.statistics.guard_calls);
    const auto never =
        run_with(Shuttle{}, fifty_seconds,
                 Metered(Foreseen(horizon_gate(0.02), unchecked), {.decision = Decision::never}));
    EXPECT_EQ(never.run.statistics.network_calls, 0U);
    expect_same(first.run, never.run);
}

TEST(Metered, APredictionThatSavesNothingIsHardlyAskedFor)
{
    Model model = shuttle_model();
    model.layers = {{2, 2, {0, 0, 0, 0}, {0, 0}}, {2, 1, {0, 0}, {1}}};
    const auto exact = integrate(Shuttle{}, at_centre, fifty_seconds, Fixed{});
    const auto verified = run_with(Shuttle{}, fifty_seconds,
                                   Metered(Verified<>(BareNetwork(model)), counted(1e-6, 1e-7)));
    expect_same(exact, verified.run);
    EXPECT_GT(verified.run.statistics.network_calls, 0U);
    EXPECT_LT(verified.run.statistics.network_calls, verified.run.statistics.steps / 20);
}

TEST(Metered, AWrongBoundIsNamedUnderAGate)
{
    const Shuttle boastful{.loose = 0.25};  // four times as fast as declared
    const Foreseen foreseen(horizon_gate(0.02), {.check_bounds = true});
    const auto run = integrate(boastful, at_centre, fifty_seconds, Fixed{}, foreseen);
    ASSERT_EQ(run.outcome, Outcome::wrong_bound);
    ASSERT_TRUE(run.wrong_bound);
    EXPECT_GT(std::fabs(run.wrong_bound->value - run.wrong_bound->value_then),
              run.wrong_bound->allowed);
}

TEST(Metered, RefusesOptionsThatMakeNoSense)
{
    const auto refusal = [](const MeterOptions& options) -> std::string {
        try {
            (void)Metered(Foreseen(horizon_gate(0.1)), options);
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "nothing was refused";
    };
    EXPECT_NE(refusal({.guard = -1}).find("guard must be zero or positive [s], got -1"),
              std::string::npos);
    EXPECT_NE(refusal({.network = nan}).find("network"), std::string::npos);
    EXPECT_NE(refusal({.step = inf}).find("step"), std::string::npos);
    EXPECT_NE(refusal({.decision = Decision::counted}).find("step must be positive"),
              std::string::npos);
    EXPECT_NE(refusal({.trials = 2}).find("trials must be in [0, 1], got 2"), std::string::npos);
    EXPECT_NE(refusal({.piece = 0}).find("piece"), std::string::npos);
}

TEST(Certified, WhatItClearsIsProvedAndSavesExactCalls)
{
    const Shuttle loose{.loose = 20};
    const Certified certified(certified_model({0.1, 0.2, 0.4}), unchecked);
    const auto exact = integrate(loose, at_centre, fifty_seconds, Fixed{});
    const auto planned = integrate(loose, at_centre, fifty_seconds, Fixed{}, Planned(unchecked));
    const auto run = integrate(loose, at_centre, fifty_seconds, Fixed{}, certified);
    expect_same(exact, run);
    EXPECT_LT(1.2 * static_cast<double>(run.statistics.guard_calls),
              static_cast<double>(planned.statistics.guard_calls));
    EXPECT_GT(run.statistics.network_calls, 0U);
    EXPECT_EQ(run.statistics.evidence.gated + run.statistics.evidence.assumed, 0U);
    EXPECT_GT(run.statistics.evidence.proved, run.statistics.steps / 2);
}

TEST(Certified, OutsideItsBoxTheExactGuardIsAsked)
{
    Model model = shuttle_model();
    model.domain = {{-0.5, 0.5}, {1.5, 2}};  // the point never moves as fast
    model.layers = {{2, 2, {1, 0, -1, 0}, {0, 0}}, {2, 1, {1, 1}, {0}}};
    model.threshold = 0.4;
    const auto proof =
        learn::certify(model, learn::guard_problem(Shuttle{}, model, at_centre), {.margin = 0.1});
    ASSERT_TRUE(proof.proved());
    const Options options{.t_end = 10, .step = 0.001};
    const auto planned = integrate(Shuttle{}, at_centre, options, Fixed{}, Planned(unchecked));
    const auto run =
        integrate(Shuttle{}, at_centre, options, Fixed{}, Certified(proof.model, unchecked));
    expect_same(planned, run);
    EXPECT_GT(run.statistics.network_calls, 0U);
    EXPECT_EQ(run.statistics.outside_domain, run.statistics.network_calls);
    EXPECT_EQ(run.statistics.evidence.proved, planned.statistics.evidence.proved);
}

TEST(Certified, RefusesAModelWithoutAValidCertificateOrForSomethingElse)
{
    const auto refusal = [](const std::function<void()>& act) -> std::string {
        try {
            act();
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "nothing was refused";
    };
    Model model = certified_model({0.1});
    Model bare = model;
    bare.certificate.clear();
    EXPECT_NE(refusal([&] { Certified given(bare); }).find("certificate"), std::string::npos);
    Model changed = model;
    changed.layers[1].bias[0] += 0.01;
    EXPECT_NE(refusal([&] { Certified given(changed); }).find("other weights"), std::string::npos);
    EXPECT_NE(refusal([&] {
                  (void)integrate(Other{}, at_centre, fifty_seconds, Fixed{}, Certified(model));
              }).find("cannot be used for other"),
              std::string::npos);
}

}  // namespace
}  // namespace ricochet::meter_test
