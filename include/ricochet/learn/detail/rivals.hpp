// Internal: the declarations of this header may change without notice.
//
// Comparison of a trained network with other methods of finding events, on the same runs.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/planned.hpp"

namespace ricochet::learn {

namespace detail {

/// Processor time of this thread's process [s].
[[nodiscard]] double processor_seconds() noexcept;

/// Time [s] by which a call of the guard would have to take longer for the network, the last of the
/// rivals, to be the fastest of those that lose no more events than the network: 0 if it is
/// already, infinite where another one calls the guard as rarely.
[[nodiscard]] double winning_price(const std::vector<Rival>& rivals);

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

/// Processor time [s] of a call of the first guard in these states, and the calls that measured it.
template <class System, class Starts>
[[nodiscard]] std::pair<double, std::uint64_t> price_of_guard(const System& system,
                                                              const Starts& states)
{
    if (states.empty()) return {0, 0};
    const double before = processor_seconds();
    [[maybe_unused]] volatile double kept = 0;  // so that no call is left out
    std::uint64_t calls = 0;
    double spent = 0;
    while (spent < 2e-3) {
        for (const auto& s : states) {
            kept = ricochet::detail::call_guard(system, 0, s.mode, s.t, s.x);
        }
        calls += states.size();
        spent = processor_seconds() - before;
    }
    return {spent / static_cast<double>(calls), calls};
}

/// Repeats runs of a system with every available method, for comparison.
template <class System, class X, class Stepping, class Network>
class RivalRuns {
public:
    /// Keeps references to its arguments.
    RivalRuns(const System& system, const Network& network) : system_(&system), network_(&network)
    {
    }

    /// Whole runs; an event found late counts as found.
    void add(const X& x0, const Options& options)
    {
        const auto all = [](const Run<X>& run) { return run.statistics.events; };
        add(x0, options, all);
    }

    /// A run to its first event, which is lost where it is not found at the time of a check at
    /// every step. Chaotic runs separate after an event, and their events can then not be compared.
    void add_flight(const X& x0, Options options)
    {
        options.stop_at_event = true;
        options.record_events = true;
        const Run<X> exact = integrate(*system_, x0, options, Stepping{}, Extremum{});
        if (exact.events.empty()) return;
        const auto& at = exact.events.back();
        const auto found = [&at](const Run<X>& run) -> std::uint64_t {
            if (run.events.empty()) return 0;
            const auto& event = run.events.back();
            const double rounding = std::numeric_limits<double>::epsilon() * std::fabs(at.t);
            return std::fabs(event.t - at.t) <= event.error + at.error + rounding ? 1 : 0;
        };
        add(x0, options, found);
    }

    [[nodiscard]] const std::vector<Rival>& rivals() const noexcept { return rivals_; }
    [[nodiscard]] std::uint64_t events() const noexcept
    {
        return rivals_.empty() ? 0 : rivals_.front().events;
    }

private:
    template <class Count>
    void add(const X& x0, const Options& options, const Count& count)
    {
        std::size_t next = 0;
        const auto run = [&](std::string_view name, const auto& detector) {
            if (next == rivals_.size()) rivals_.push_back({.name = std::string(name)});
            Rival& rival = rivals_[next++];
            const double before = processor_seconds();
            const Run<X> done = integrate(*system_, x0, options, Stepping{}, detector);
            rival.seconds += processor_seconds() - before;
            rival.guard_calls += done.statistics.guard_calls;
            rival.events += count(done);
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

    const System* system_;
    const Network* network_;
    std::vector<Rival> rivals_;
};

}  // namespace detail

}  // namespace ricochet::learn
