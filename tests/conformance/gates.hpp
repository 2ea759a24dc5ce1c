// Conformance suite of gates, detectors that ask a network, in a run.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <ostream>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::test {

/// A point that goes back and forth between two walls at -1 and 1, at unit speed.
struct Shuttle {
    using State = std::array<double, 2>;
    static constexpr std::string_view name = "shuttle";

    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = 0;
    }
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        return 1 - std::fabs(x[0]);
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double, const X& x, const D& dxdt) const
    {
        return x[0] > 0 ? -dxdt[0] : dxdt[0];
    }
    template <class X>
    void reset(double, X& x) const
    {
        x[1] = -x[1];
    }
    template <class X>
    [[nodiscard]] double speed_bound(double, const X& x) const
    {
        return std::fabs(x[1]);
    }
    template <class X>
    [[nodiscard]] double guard_slack(const X& half_widths) const
    {
        return half_widths[0] + 1e-15;
    }
};

using ShuttleRun = Run<Shuttle::State>;

/// Eight walls in 1600 steps, from the centre.
template <class Detector>
[[nodiscard]] ShuttleRun shuttle_run(const Detector& detector)
{
    return integrate(Shuttle{}, {0.0, 1.0}, {.t_end = 16, .step = 0.01}, FixedStep<Rk4>{},
                     detector);
}

/// A network that returns |x| `outputs` times, less the biases.
[[nodiscard]] inline Model shuttle_model(std::string_view kind, const std::vector<double>& less)
{
    Model model;
    model.kind = kind;
    model.system = Shuttle::name;
    model.recipe = "state";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.domain = {{-1.5, 1.5}, {-2, 2}};
    model.step_min = model.step_max = 0.01;
    model.precision = Precision::f64;
    model.layers = {{2, 2, {1, 0, -1, 0}, {0, 0}}, {2, less.size(), {}, {}}};
    for (const double b : less) {
        model.layers[1].weight.insert(model.layers[1].weight.end(), {1, 1});
        model.layers[1].bias.push_back(-b);
    }
    return model;
}

/// Announces an event if the point is at most two steps from a wall.
[[nodiscard]] inline Model true_prediction()
{
    return shuttle_model("event-classifier", {0.98});
}

/// Clears the horizon tau if the point is farther than that from both walls.
[[nodiscard]] inline Model true_horizons()
{
    const std::vector<double> horizons{0.02, 0.08, 0.32};
    Model model = shuttle_model("gate-horizon", {0.979, 0.919, 0.679});
    for (const double tau : horizons) model.levels.push_back({.value = tau, .threshold = 0});
    return model;
}

/// Clears the level g if the guard is above it.
[[nodiscard]] inline Model true_levels()
{
    Model model = shuttle_model("gate-level", {0});
    for (const double g : {0.05, 0.2, 0.4}) {
        model.levels.push_back({.value = g, .threshold = 0.999 - g});
    }
    return model;
}

/// A gate with a network that predicts correctly, and the promises of the gate.
struct GateCase {
    std::string name;
    std::function<ShuttleRun(const Model&)> run;
    const ShuttleRun* exact;  ///< of the detector to which the gate leaves the other steps
    Model truth;
    bool keeps_events = false;              ///< of the exact detector, with any weights
    bool returns = false;                   ///< it finds the guard on its other side
    bool saves = true;                      ///< exact calls, with a network that predicts correctly
    bool plans = false;                     ///< by bounds in addition to the cleared intervals
    bool refuses_other_weights = false;     ///< since its proof is for these
    Evidence deferred = Evidence::checked;  ///< of the steps that it does not examine
};

inline void PrintTo(const GateCase& gate, std::ostream* out)
{
    *out << gate.name;
}

/// The run of an exact detector.
template <class Exact>
[[nodiscard]] const ShuttleRun& exact_run()
{
    static const ShuttleRun run = shuttle_run(Exact{});
    return run;
}

template <class Exact = Extremum, class MakeGate>
[[nodiscard]] GateCase any_gate(const std::string& name, const Model& truth, const MakeGate& make)
{
    return {.name = name,
            .run = [=](const Model& model) { return shuttle_run(make(model)); },
            .exact = &exact_run<Exact>(),
            .truth = truth};
}

class GateSuite : public testing::TestWithParam<GateCase> {
protected:
    static const ShuttleRun& exact() { return *GetParam().exact; }

    static const Model& truth() { return GetParam().truth; }

    static void expect_nothing_cleared(const ShuttleRun& run)
    {
        EXPECT_TRUE(same_events(run, exact()));
        EXPECT_EQ(run.statistics.missed_events, 0U);
        if (GetParam().plans) return;
        EXPECT_EQ(run.statistics.evidence.gated, 0U);
        EXPECT_EQ(run.statistics.checks_deferred, 0U);
    }

    /// The correct model with every weight from `next`.
    template <class Next>
    [[nodiscard]] static Model with_weights(std::size_t hidden, Next&& next)
    {
        Model model = truth();
        const std::size_t outputs = model.layers.back().outputs;
        model.layers = {{2, hidden, {}, {}}, {hidden, outputs, {}, {}}};
        for (DenseLayer& layer : model.layers) {
            for (std::size_t i = 0; i < layer.inputs * layer.outputs; ++i) {
                layer.weight.push_back(next());
            }
            for (std::size_t i = 0; i < layer.outputs; ++i) layer.bias.push_back(next());
        }
        return model;
    }

    /// One that clears everything that it can, or nothing, in every state.
    [[nodiscard]] static Model constant(double output)
    {
        Model model = with_weights(2, [] { return 0.0; });
        for (double& bias : model.layers.back().bias) bias = output;
        return model;
    }

    /// Random weights of all sizes, constants, and weights that are not numbers.
    [[nodiscard]] static std::vector<Model> hostile()
    {
        std::mt19937_64 random(5);
        std::normal_distribution normal;
        std::vector<Model> out;
        for (int i = 0; i < 42; ++i) {
            const double size = std::pow(10, static_cast<double>(i % 7) - 3);
            out.push_back(with_weights(4, [&] { return size * normal(random); }));
        }
        const double inf = std::numeric_limits<double>::infinity();
        for (const double weight : {0.0, 1e30, -1e30, std::nan(""), inf, -inf}) {
            out.push_back(with_weights(4, [=] { return weight; }));
        }
        out.push_back(constant(-1e9));
        out.push_back(constant(1e9));
        return out;
    }

    [[nodiscard]] static bool same_events(const ShuttleRun& a, const ShuttleRun& b)
    {
        const auto same = [](const auto& p, const auto& q) {
            return p.t == q.t && p.before == q.before && p.after == q.after &&
                   p.bracket.lo == q.bracket.lo;
        };
        return a.outcome == b.outcome && a.t == b.t && a.x == b.x &&
               a.statistics.steps == b.statistics.steps &&
               std::equal(a.events.begin(), a.events.end(), b.events.begin(), b.events.end(), same);
    }

    /// Calls check(run) with every hostile network that is not refused.
    template <class Check>
    static void for_hostile(Check&& check)
    {
        const std::vector<Model> models = hostile();
        for (std::size_t i = 0; i < models.size() && !HasFailure(); ++i) {
            SCOPED_TRACE("network " + std::to_string(i));
            if (GetParam().refuses_other_weights) {
                EXPECT_THROW((void)GetParam().run(models[i]), std::invalid_argument);
            } else {
                check(GetParam().run(models[i]));
            }
        }
    }
};

TEST_P(GateSuite, TheTruthKeepsTheEventsAndSavesCalls)
{
    const ShuttleRun run = GetParam().run(truth());
    EXPECT_EQ(exact().events.size(), 8U);
    EXPECT_TRUE(same_events(run, exact()));
    EXPECT_GT(run.statistics.network_calls, 0U);
    EXPECT_EQ(run.statistics.missed_events, 0U);
    EXPECT_EQ(run.statistics.late_events, 0U);
    if (GetParam().saves) {
        EXPECT_LT(run.statistics.guard_calls, exact().statistics.guard_calls / 2);
        EXPECT_GT(run.statistics.checks_deferred, run.statistics.steps / 2);
    }
}

TEST_P(GateSuite, AnyWeightsKeepTheEventsWhereThatIsPromised)
{
    if (!GetParam().keeps_events) return;
    for_hostile([](const ShuttleRun& run) { EXPECT_TRUE(same_events(run, exact())); });
}

TEST_P(GateSuite, AGuardThatStaysBeyondItsSurfaceIsReturnedToWhereThatIsPromised)
{
    if (!GetParam().returns) return;
    // Nothing turns the point back at a wall whose event is missed.
    EXPECT_TRUE(same_events(GetParam().run(constant(-1e9)), exact()));
}

TEST_P(GateSuite, AMissedEventIsNeverHiddenBehindEvidence)
{
    for_hostile([](const ShuttleRun& run) {
        if (same_events(run, exact())) return;
        const EvidenceCounts& evidence = run.statistics.evidence;
        EXPECT_TRUE(evidence.gated + evidence.assumed > 0 || run.outcome == Outcome::wrong_bound);
    });
}

TEST_P(GateSuite, WhatIsNotCheckedIsNamed)
{
    const auto check = [](const ShuttleRun& run) {
        const Statistics& s = run.statistics;
        const EvidenceCounts& e = s.evidence;
        if (GetParam().deferred != Evidence::gated) {
            EXPECT_EQ(e.gated, 0U);
        }
        if (GetParam().deferred != Evidence::assumed) {
            EXPECT_EQ(e.assumed, 0U);
        }
        if (GetParam().deferred != Evidence::proved) {
            EXPECT_EQ(e.proved, 0U);
        }
        // Every step has its evidence or an event.
        if (run.outcome == Outcome::reached_end) {
            EXPECT_EQ(e.proved + e.checked + e.gated + e.assumed + s.events, s.steps);
        }
    };
    check(GetParam().run(truth()));
    for_hostile(check);
}

TEST_P(GateSuite, OutsideItsBoxNothingIsCleared)
{
    if (GetParam().refuses_other_weights) return;  // the box is part of the proof
    Model elsewhere = constant(-1e9);
    elsewhere.domain = {{5, 6}, {-2, 2}};
    const ShuttleRun run = GetParam().run(elsewhere);
    expect_nothing_cleared(run);
}

TEST_P(GateSuite, ANetworkThatIsNoNumberClearsNothing)
{
    if (GetParam().refuses_other_weights) return;
    const ShuttleRun run = GetParam().run(with_weights(4, [] { return std::nan(""); }));
    expect_nothing_cleared(run);
}

TEST_P(GateSuite, ANetworkThatNeverClearsOnlyCostsTime)
{
    if (GetParam().refuses_other_weights) return;
    const ShuttleRun run = GetParam().run(constant(1e9));
    EXPECT_TRUE(same_events(run, exact()));
    EXPECT_EQ(run.statistics.missed_events, 0U);
    EXPECT_GT(run.statistics.network_calls, 0U);
    if (!GetParam().plans) {
        EXPECT_EQ(run.statistics.checks_deferred, 0U);
    }
}

TEST_P(GateSuite, AModelForSomethingElseIsRefused)
{
    const auto expect_refused = [](const std::function<void(Model&)>& change) {
        Model model = truth();
        change(model);
        EXPECT_THROW((void)GetParam().run(model), std::invalid_argument);
    };
    expect_refused([](Model& model) { model.system = "pendulum"; });
    expect_refused([](Model& model) { model.recipe = "entrails"; });
    expect_refused([](Model& model) { model.recipe = "state-rate"; });
    if (!GetParam().refuses_other_weights) {
        // A certificate is about states, and steps may have any length.
        expect_refused([](Model& model) { model.step_min = model.step_max = 0.02; });
    }
}

}  // namespace ricochet::test
