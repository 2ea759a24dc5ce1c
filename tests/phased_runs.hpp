// Runs of systems with set_valued() through all adapters, and what is expected of them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "ricochet/ricochet.hpp"
#include "sliding_systems.hpp"
#ifdef RICOCHET_TESTS_IN_C
#include "c_runs.hpp"
#endif

namespace ricochet {

/// Bound of the errors of location where the motion is a polynomial that the method integrates
/// exactly: what is left is rounding.
constexpr double exact_motion = 1e-9;

[[nodiscard]] inline Options until(double t_end)
{
    return {.t_end = t_end, .rtol = 1e-10, .atol = 1e-12};
}

/// Runs to the end by steps; after every tenth a new simulation goes on from what was saved.
template <class System, class X>
[[nodiscard]] X end_by_snapshots(const System& system, const X& x0, const Options& options)
{
    auto simulation = std::make_unique<Simulation<System, X>>(system, x0, options);
    for (int steps = 1; simulation->step(); ++steps) {
        if (steps % 10 != 0) continue;
        const Snapshot saved = simulation->save();
        simulation = std::make_unique<Simulation<System, X>>(system, x0, options);
        simulation->restore(saved);
    }
    return simulation->x();
}

/// Integrates through all adapters, that for C among them, which have to agree, and returns the run
/// of `integrate`.
template <class System, class X>
[[nodiscard]] auto run_of(const System& system, const X& x0, const Options& options)
{
    Simulation whole(system, x0, options);
    while (whole.step()) {
    }
    EXPECT_EQ(end_by_snapshots(system, x0, options), whole.x());
    auto run = integrate(system, x0, options);
    for (std::size_t i = 0; i < x0.size(); ++i) {
        EXPECT_NEAR(run.x[i], whole.x()[i], exact_motion) << i;
    }
    EXPECT_EQ(run.outcome, whole.run().outcome);
#ifdef RICOCHET_TESTS_IN_C
    if constexpr (SystemInC<System, X>::fits) {
        expect_same_in_c(system, x0, options, run, exact_motion);
    }
#endif
    return run;
}

template <class Run, class X>
void expect_end(const Run& run, const X& x, double error = exact_motion)
{
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.t << ' ' << run.reason;
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(run.x[i], x[i], error) << i;
}

template <class Events>
[[nodiscard]] std::vector<double> times_at(const Events& events, std::size_t guard, EventKind kind)
{
    std::vector<double> times;
    for (const auto& event : events) {
        if (event.guard == guard && event.kind == kind) times.push_back(event.t);
    }
    return times;
}

inline void expect_times(const std::vector<double>& found, const std::vector<double>& expected,
                         double error = exact_motion)
{
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], error) << k;
}

/// The next of these times, as time events.
[[nodiscard]] inline auto at_times(std::vector<double> times)
{
    return [times = std::move(times)](double t) {
        for (const double time : times) {
            if (time > t) return time;
        }
        return std::numeric_limits<double>::infinity();
    };
}

/// An inclusion whose set is a box, with A the unit matrix and without an offset, as the motion of
/// a system whose flow is written with the signs of y.
template <class Set>
struct WithSigns {
    static constexpr int n = state_size<Set>, m = reaction_size<Set>;
    using State = std::array<double, static_cast<std::size_t>(n)>;
    Set set;

    void flow(double t, const State& x, State& dxdt) const
    {
        const StateOf<Set> w = Eigen::Map<const StateOf<Set>>(x.data());
        const auto box = set.reaction_set(t, w);
        Eigen::Matrix<double, m, n, m == 1 && n != 1 ? Eigen::RowMajor : Eigen::ColMajor> e;
        e.setIdentity();
        if constexpr (requires { set.observe(e); }) set.observe(e);
        Eigen::Matrix<double, n, m, n == 1 && m != 1 ? Eigen::RowMajor : Eigen::ColMajor> g =
            e.transpose();
        if constexpr (requires { set.act(g); }) set.act(g);
        StateOf<Set> f;
        set.smooth(t, w, f);
        for (int i = 0; i < m; ++i) {
            const double y = e.row(i).dot(w);
            const auto k = static_cast<std::size_t>(i);
            f += (y > 0 ? box.lower(k) : y < 0 ? box.upper(k) : 0) * g.col(i);
        }
        std::copy_n(f.data(), n, dxdt.begin());
    }
    [[nodiscard]] Set set_valued() const { return set; }
};

/// A body that two contacts hold at once, with bounds 1 and 3, under the load t.
struct TwoContacts {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;

    struct Motion {
        static constexpr int state_size = 1, reaction_size = 2;
        using Vector = Eigen::Matrix<double, 1, 1>;
        using Reaction = Eigen::Vector2d;

        static void smooth(double t, const Vector&, Vector& out) { out[0] = t; }
        static void observe(Eigen::Matrix<double, 2, 1>& e) { e << 1, 1; }
        static void act(Eigen::Matrix<double, 1, 2>& g) { g << 1, 1; }
        static sets::Box<2> reaction_set(double, const Vector&)
        {
            return sets::Box<2>({-1, -3}, {1, 3});
        }
    };

    static void flow(double t, const State& x, State& dxdt) { dxdt[0] = t - (x[0] >= 0 ? 4 : -4); }
    static double guard(double, const State& x) { return x[0]; }
    static GuardInfo guard_info() { return {.crossing = Crossing::either, .resets = false}; }
    static Motion set_valued() { return {}; }
};

/// The same on two belts, which stand still. What two belts hold is not determined by the motion
/// in branches, but by implicit steps.
struct TwoContactsOnBelts : TwoContacts {
    struct Motion : TwoContacts::Motion {
        static void offset(double, Reaction& s) { s.setZero(); }
        static void offset_rate(double, Reaction& rate) { rate.setZero(); }
    };
    static Motion set_valued() { return {}; }
};

}  // namespace ricochet
