// Number of guard evaluations that a perfect forecast would need: a limit for all detectors that
// decide when to check.
//
// The states at the ends of the steps of a run are recorded, with the guard and its bounds. From
// each evaluation the greedy planner goes to the furthest step at which an evaluation closes the
// interval; it knows this step, since it has the whole run. A step that no two evaluations close is
// left to the exact detector, at the cost of one evaluation at its end. The "bounded" count also
// uses the bound of the value at the end of any step, at no cost, where that closes an interval.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/hybrid/bounds.hpp"
#include "ricochet/integrate/simulation.hpp"

namespace ricochet::bench {

/// FNV-1a over 64-bit words.
class BitHash {
public:
    void add(std::uint64_t word) noexcept { hash_ = (hash_ ^ word) * 0x100000001b3U; }
    void add(double value) noexcept { add(std::bit_cast<std::uint64_t>(value)); }
    [[nodiscard]] std::uint64_t value() const noexcept { return hash_; }

private:
    std::uint64_t hash_ = 0xcbf29ce484222325U;
};

/// A guard at the end of a step.
struct SeenGuard {
    double time = 0;  ///< [s]
    double value = 0;
    double lower = -std::numeric_limits<double>::infinity();
    double upper = std::numeric_limits<double>::infinity();
    double speed = 0;
    double acceleration = 0;
};

struct OracleCalls {
    std::uint64_t checks = 0;          ///< evaluations, if only exact values are used
    std::uint64_t bounded_checks = 0;  ///< evaluations, if bounds of the value are free
    std::uint64_t steps = 0;
};

/// Number of evaluations that one guard needs over one smooth piece of motion, whose last step may
/// end in an event. `margin` is that of the planner.
[[nodiscard]] std::uint64_t count_checks(const std::vector<SeenGuard>& piece, double margin,
                                         bool with_bounds);

/// Counts over a run with a check at every step.
template <class Stepping, class System>
[[nodiscard]] OracleCalls count_oracle(const System& system, const typename System::State& x0,
                                       const Options& options)
{
    using X = typename System::State;
    struct Seen {
        double t;
        X x;
        bool after_reset;
    };
    std::vector<Seen> path{{options.t_start, x0, true}};
    Simulation simulation(system, x0, options, Stepping{}, Extremum{});
    std::uint64_t events = 0;
    while (simulation.step()) {
        const bool fired = simulation.run().statistics.events != events;
        events = simulation.run().statistics.events;
        path.push_back({simulation.t(), simulation.x(), fired && Resetting<System, X>});
    }

    OracleCalls calls{.steps = path.size() - 1};
    const double margin = PlannerOptions{}.margin;
    std::vector<SeenGuard> piece;
    const auto close_piece = [&] {
        calls.checks += count_checks(piece, margin, false);
        calls.bounded_checks += count_checks(piece, margin, true);
        piece.clear();
    };
    const std::size_t guards = guard_count_of<X>(system);
    for (std::size_t i = 0; i < guards; ++i) {
        const double l = detail::call_lipschitz(system, i);
        for (const Seen& at : path) {
            SeenGuard seen{
                .time = at.t,
                .value = detail::call_guard(system, i, Mode{}, at.t, at.x),
                .speed = l * detail::call_speed_bound(system, i, Mode{}, at.t, at.x),
                .acceleration = l * detail::call_acceleration_bound(system, i, Mode{}, at.t, at.x)};
            if constexpr (detail::HasLowerBound<System, X>) {
                seen.lower = detail::call_lower_bound(system, i, Mode{}, at.t, at.x);
            }
            if constexpr (detail::HasUpperBound<System, X>) {
                seen.upper = detail::call_upper_bound(system, i, Mode{}, at.t, at.x);
            }
            if (at.after_reset && !piece.empty()) {
                // the step with the event: it ends at the surface
                SeenGuard last = seen;
                last.value = 0;
                piece.push_back(last);
                close_piece();
            }
            piece.push_back(seen);
        }
        close_piece();
    }
    return calls;
}

}  // namespace ricochet::bench
