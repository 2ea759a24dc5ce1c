// The bounds that a system declares, sampled along one of its runs.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "refusal.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

/// A bound of one of the guards, with or without a number for it.
#define RICOCHET_TEST_BOUND(name)                                                            \
    template <class System, class X>                                                         \
    [[nodiscard]] double name##_of(const System& s, std::size_t which, double t, const X& x) \
    {                                                                                        \
        if constexpr (requires { s.name(which, t, x); }) {                                   \
            return s.name(which, t, x);                                                      \
        } else {                                                                             \
            return s.name(t, x);                                                             \
        }                                                                                    \
    }
RICOCHET_TEST_BOUND(speed_bound)
RICOCHET_TEST_BOUND(acceleration_bound)
RICOCHET_TEST_BOUND(lower_bound)
RICOCHET_TEST_BOUND(upper_bound)
#undef RICOCHET_TEST_BOUND

template <class System>
[[nodiscard]] double lipschitz_of(const System& s, std::size_t which)
{
    if constexpr (requires { s.lipschitz(which); }) {
        return s.lipschitz(which);
    } else {
        return s.lipschitz();
    }
}

/// Number of evaluations of each bound, and of its violations.
struct BoundsSampled {
    std::size_t samples = 0;
    std::size_t broken_way = 0;    ///< the guard changed by more than the path length allows
    std::size_t broken_speed = 0;  ///< the speed changed by more than its rate allows
    std::size_t broken_lower = 0;  ///< the guard is below its lower bound
    std::size_t broken_upper = 0;  ///< the guard is above its upper bound
    double closest_way = 0;        ///< the largest fraction of an allowed change that was used
};

/// A run in steps of `step`, with `count` samples.
template <class System, class X>
[[nodiscard]] Run<X> sampled_run(const System& system, const X& x0, double t_end, double step,
                                 std::size_t count)
{
    Options options{.t_end = t_end, .step = step};
    for (std::size_t i = 0; i <= count; ++i) {
        options.sample_times.push_back(t_end * static_cast<double>(i) / static_cast<double>(count));
    }
    return integrate(system, x0, options, FixedStep<Rk4>{}, Ends{});
}

/// Compares pairs of samples with no event between them, from both of their ends.
///
/// A guard is evaluated along the numerical motion, which differs from the true one by the error of
/// the steps; the allowance 1e-9 of the scale is far above that and far below any bound.
template <class System, class X>
[[nodiscard]] BoundsSampled sample_bounds(const System& system, const Run<X>& run,
                                          std::size_t which)
{
    BoundsSampled out;
    std::vector<double> g, v;
    const auto& times = run.trajectory.t;
    for (std::size_t i = 0; i < times.size(); ++i) {
        const X& x = run.trajectory.x[i];
        g.push_back(detail::call_guard(system, which, 0, times[i], x));
        v.push_back(speed_bound_of(system, which, times[i], x));
        if constexpr (
            requires { system.lower_bound(times[i], x); } ||
            requires { system.lower_bound(which, times[i], x); }) {
            if (lower_bound_of(system, which, times[i], x) > g.back() + 1e-12) ++out.broken_lower;
        }
        if constexpr (
            requires { system.upper_bound(times[i], x); } ||
            requires { system.upper_bound(which, times[i], x); }) {
            if (upper_bound_of(system, which, times[i], x) < g.back() - 1e-12) ++out.broken_upper;
        }
    }
    const auto events_until = [&](double t) {
        return std::upper_bound(run.events.begin(), run.events.end(), t,
                                [](double at, const auto& event) { return at < event.t; }) -
               run.events.begin();
    };
    const double lipschitz = lipschitz_of(system, which);
    for (const std::size_t gap : {1U, 3U, 10U, 40U}) {
        for (std::size_t i = 0; i + gap < times.size(); i += 1 + gap / 3) {
            const std::size_t j = i + gap;
            if (events_until(times[i]) != events_until(times[j])) continue;
            ++out.samples;
            const double tau = times[j] - times[i];
            for (const std::size_t k : {i, j}) {
                const double a =
                    acceleration_bound_of(system, which, times[k], run.trajectory.x[k]);
                const double way = lipschitz * (v[k] * tau + a * tau * tau / 2);
                const double change = std::fabs(g[j] - g[i]);
                if (!(change <= way + 1e-9)) ++out.broken_way;
                if (!(std::fabs(v[j] - v[i]) <= a * tau + 1e-9)) ++out.broken_speed;
                if (way > 1e-6) out.closest_way = std::max(out.closest_way, change / way);
            }
        }
    }
    return out;
}

/// Expects that no bound is broken in at least `count` samples, and that the bounds are not too
/// wide to be broken: somewhere `used` of the allowed change was used.
inline void expect_bounds_hold(const BoundsSampled& sampled, std::size_t count, double used)
{
    EXPECT_GE(sampled.samples, count);
    EXPECT_EQ(sampled.broken_way, 0U);
    EXPECT_EQ(sampled.broken_speed, 0U);
    EXPECT_EQ(sampled.broken_lower, 0U);
    EXPECT_EQ(sampled.broken_upper, 0U);
    EXPECT_GT(sampled.closest_way, used);
    EXPECT_LE(sampled.closest_way, 1 + 1e-3);
}

}  // namespace ricochet
