// Internal: the declarations of this header may change without notice.
//
// Comparison of a trained network with other methods of finding events, on the same runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/planned.hpp"

namespace ricochet::learn {

namespace detail {

/// Processor time of this thread's process [s].
[[nodiscard]] double processor_seconds() noexcept;

/// Guard calls and time of runs.
struct RunCost {
    std::uint64_t events = 0;
    std::uint64_t steps = 0;
    std::uint64_t guard_calls = 0;
    double seconds = 0;  ///< of processor time

    /// Extrapolates to longer runs: until `wanted` events, or `most` steps in all.
    [[nodiscard]] TrainingEstimate for_events(std::uint64_t wanted,
                                              std::uint64_t most) const noexcept;
};

/// Cost of the runs that `start` produces, measured over 20 events or a fifth of a second; at
/// most 100 000 steps and two seconds where there is no event.
template <class Start>
[[nodiscard]] RunCost cost_of_runs(const Start& start)
{
    RunCost cost;
    const double before = processor_seconds();
    const auto goes_on = [&](std::uint64_t events, std::uint64_t steps) {
        cost.seconds = processor_seconds() - before;
        return events < 20 && steps < 100'000 && cost.seconds < (events > 0 ? 0.2 : 2);
    };
    while (goes_on(cost.events, cost.steps)) {
        auto run = start();
        const Statistics& counts = run.run().statistics;
        while (run.step() && goes_on(cost.events + counts.events, cost.steps + counts.steps)) {
        }
        cost.events += counts.events;
        cost.steps += counts.steps + 1;
        cost.guard_calls += counts.guard_calls;
    }
    return cost;
}

/// Repeats runs of a system with every available method, for comparison.
template <class System, class X, class Stepping, class Network>
class RivalRuns {
public:
    /// Keeps references to its arguments.
    RivalRuns(const System& system, const Network& network) : system_(&system), network_(&network)
    {
    }

    void add(const X& x0, const Options& options)
    {
        std::size_t next = 0;
        const auto run = [&](std::string_view name, const auto& detector) {
            if (next == rivals_.size()) rivals_.push_back({.name = std::string(name)});
            Rival& rival = rivals_[next++];
            const double before = processor_seconds();
            const Statistics counts =
                integrate(*system_, x0, options, Stepping{}, detector).statistics;
            rival.seconds += processor_seconds() - before;
            rival.guard_calls += counts.guard_calls;
            rival.events += counts.events;
        };
        run("every step", Extremum{});
        run("the end of every step", Ends{});
        run("every 2 steps", EveryK(2));
        run("every 4 steps", EveryK(4));
        run("every 8 steps", EveryK(8));
        if constexpr (BoundedGuards<System, X>) {
            bool bounded = true;
            if constexpr (requires { system_->is_bounded(); }) bounded = system_->is_bounded();
            if (bounded) run("what bounds demand", Planned{});
        }
        run("the network", *network_);
    }

    [[nodiscard]] const std::vector<Rival>& rivals() const noexcept { return rivals_; }
    [[nodiscard]] std::uint64_t events() const noexcept
    {
        return rivals_.empty() ? 0 : rivals_.front().events;
    }

private:
    const System* system_;
    const Network* network_;
    std::vector<Rival> rivals_;
};

}  // namespace detail

}  // namespace ricochet::learn
