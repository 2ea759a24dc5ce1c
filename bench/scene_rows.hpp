// A scene with an expensive guard, run with a check at every step and planned: the same events,
// processor time, exact calls, and the calls that a perfect forecast would need.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "scene_oracle.hpp"
#include "timing.hpp"

namespace ricochet::bench {

/// Hash (FNV-1a) of the bits by which two runs are compared: kind, guard, time and both states of
/// every event, and the end.
template <class X>
[[nodiscard]] std::uint64_t hash_of(const Run<X>& run)
{
    BitHash hash;
    hash.add(static_cast<std::uint64_t>(run.outcome));
    hash.add(run.t);
    for (const double value : run.x) hash.add(value);
    for (const auto& event : run.events) {
        hash.add(static_cast<std::uint64_t>(event.kind));
        hash.add(event.guard);
        hash.add(event.t);
        for (const double value : event.before) hash.add(value);
        for (const double value : event.after) hash.add(value);
    }
    return hash.value();
}

/// One scene, with a check at every step and planned, each with the efficient guard and with a
/// guard that examines every segment, edge or face. Both guards give the same bits.
struct SceneRow {
    std::string name;
    std::size_t guards = 1;
    Statistics every{}, planned{};
    OracleCalls oracle{};
    bool same = false;       ///< events and end of all runs, bit for bit
    double alone = 0;        ///< [s] a run without guards
    double every_brute = 0;  ///< [s] a check at every step
    double every_built = 0;
    double planned_brute = 0;  ///< [s] planned
    double planned_built = 0;

    /// Exact calls that locating an event takes beyond those at the ends of steps.
    [[nodiscard]] double location() const;
    /// A check at every step by brute force, over planned with the efficient guard.
    [[nodiscard]] double time_ratio() const { return every_brute / planned_built; }
    /// The same ratio with brute force for both.
    [[nodiscard]] double brute_ratio() const { return every_brute / planned_brute; }
    [[nodiscard]] double call_ratio() const
    {
        return static_cast<double>(every.guard_calls) / static_cast<double>(planned.guard_calls);
    }
    /// Calls a step with a perfect forecast, and location.
    [[nodiscard]] double oracle_calls(std::uint64_t checks) const;
};

/// Table of the rows, with a verdict: all must have the same events in all runs, and at least one;
/// the first `demanded` rows must reach the target.
[[nodiscard]] Measured scene_table(const std::vector<SceneRow>& rows, std::size_t demanded,
                                   double target, double (SceneRow::*ratio)() const);

/// A planner that does not check bounds, as in release builds, whatever the build.
[[nodiscard]] inline Planned<> planner(bool two_ended = true)
{
    return Planned<>({.two_ended = two_ended, .check_bounds = false});
}

/// `built` and `brute` give the same bits; the second is null where there is one guard only.
/// `budget` [s] for each way of running.
template <class Stepping, class System>
[[nodiscard]] SceneRow compare_scene(const std::string& name, const System& built,
                                     const System* brute, const Options& options, double budget)
{
    using X = typename System::State;
    const X x0 = built.start();
    const auto every = [&](const System& system) {
        return integrate(system, x0, options, Stepping{}, Extremum{});
    };
    const auto planned = [&](const System& system) {
        return integrate(system, x0, options, Stepping{}, planner());
    };
    SceneRow row{.name = name, .guards = guard_count_of<X>(built)};
    const System& slow = brute != nullptr ? *brute : built;
    const auto exact = every(slow);
    const auto plan = planned(built);
    row.every = exact.statistics;
    row.planned = plan.statistics;
    const std::uint64_t hash = hash_of(exact);
    row.same = hash_of(plan) == hash && plan.statistics.steps == exact.statistics.steps;
    if (brute != nullptr) {
        row.same = row.same && hash_of(every(built)) == hash && hash_of(planned(*brute)) == hash;
    }
    row.oracle = count_oracle<Stepping>(built, x0, options);

    const Unguarded<System> unguarded(built);
    std::vector<Work> works{
        repeated([&] { return integrate(unguarded, x0, options, Stepping{}, Ends{}); }),
        repeated([&] { return planned(built); }), repeated([&] { return every(built); })};
    if (brute != nullptr) {
        works.push_back(repeated([&] { return planned(*brute); }));
        works.push_back(repeated([&] { return every(*brute); }));
    }
    const auto timings = time_in_turns(works, {.budget = budget, .fewest = 3});
    row.alone = timings[0].median;
    row.planned_built = row.planned_brute = timings[1].median;
    row.every_built = row.every_brute = timings[2].median;
    if (brute != nullptr) {
        row.planned_brute = timings[3].median;
        row.every_brute = timings[4].median;
    }
    return row;
}

}  // namespace ricochet::bench
