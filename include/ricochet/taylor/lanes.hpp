// Many runs by Taylor's method on one core, four at a time.
//
//     #include "ricochet/taylor/lanes.hpp"
//     const std::vector<Pendulum::State> starts = ...;
//     const auto runs = integrate_lanes(pendulum, starts, {.t_end = 1000, .rtol = 1e-12});
//     for (const auto& run : runs.rows) use(run->x);
//
// The series of four runs are computed side by side, in registers of four doubles where the
// processor has them and in pairs where not. Each run has steps, events and resets of its own;
// around an event it is alone for a step or two, and where it ends the next one takes its place.
#pragma once

#include <array>
#include <cstddef>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/lending_loop.hpp"
#include "ricochet/ensemble.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/taylor/detail/taylor_lanes.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet {

namespace detail {

/// Whether the compiler fuses products and sums, as it may when compiling for a machine with such
/// an instruction: then the bits of a result depend on which products it fuses.
[[nodiscard]] inline bool fuses_products() noexcept
{
    const volatile double above = 1 + 0x1p-30, below = 1 - 0x1p-30, less = -1;
    const double a = above, b = below, c = less;
    return a * b + c != 0;  // a b rounds to 1
}

/// Results of runs that are done in any order.
template <class X>
class LaneResults {
public:
    explicit LaneResults(std::size_t rows) { out_.rows.resize(rows); }

    /// Calls `run()` for a row, and keeps the exception that it throws. False: it has thrown one.
    template <class Function>
    bool attempt(std::size_t row, const Function& run)
    {
        try {
            run();
            return true;
        } catch (const std::exception& error) {
            failures_[row] = {row, std::current_exception(), error.what()};
        } catch (...) {
            failures_[row] = {row, std::current_exception(),
                              "an exception that is no std::exception"};
        }
        return false;
    }
    void keep(std::size_t row, Run<X>&& run) { out_.rows[row].emplace(std::move(run)); }

    [[nodiscard]] Ensemble<Run<X>> take()
    {
        for (auto& [row, failure] : failures_) out_.failures.push_back(std::move(failure));
        out_.complete = true;
        return std::move(out_);
    }

private:
    Ensemble<Run<X>> out_;
    std::map<std::size_t, RowFailure> failures_;
};

/// Runs rows in lanes; a run that has ended is replaced by the next row.
/// @tparam Rows  what the rows are: `Parts` of a run, with `setup()` and `adapter()`; `count()`
/// rows; `open(parts, row)`, `start(row)`, whether a run `shares(adapter)` its series,
/// `attempt(row, f)` and `keep(row, run)`
template <class Lanes, class Rows>
class LaneRuns {
    using Parts = typename Rows::Parts;
    using C = typename Rows::Start;

public:
    LaneRuns(Lanes& lanes, Rows& rows, const Options& options)
        : lanes_(lanes), rows_(rows), options_(options)
    {
    }

    void run()
    {
        for (std::size_t lane = 0; lane < lane_count; ++lane) fill(lane);
        while (lanes_.active_count() > 1) {
            const unsigned waiting = lanes_.advance();
            for (std::size_t lane = 0; lane < lane_count; ++lane) {
                if (waiting >> lane & 1U) serve(lane);
            }
        }
        for (std::size_t lane = 0; lane < lane_count; ++lane) {
            if (lanes_.is_active(lane)) finish_alone(lane);
        }
    }

private:
    struct Slot {
        std::optional<Parts> parts;
        std::unique_ptr<LendingLoop<C>> loop;
        QuietRun quiet;
        std::size_t row = 0;
    };

    /// Begins runs until one has reached steps that may be quiet.
    void fill(std::size_t lane)
    {
        Slot& slot = slots_[lane];
        while (next_ < rows_.count() && !lanes_.is_active(lane)) {
            slot.row = next_++;
            rows_.attempt(slot.row, [&] { begin(slot, lane); });
        }
    }

    void begin(Slot& slot, std::size_t lane)
    {
        slot.loop.reset();
        rows_.open(slot.parts, slot.row);
        const auto setup = slot.parts->setup();
        const auto& adapter =
            static_cast<const typename Lanes::SystemAdapter&>(slot.parts->adapter());
        if (!setup.quiet || !rows_.shares(adapter)) {
            rows_.keep(slot.row, run_whole(setup, rows_.start(slot.row), options_));
            return;
        }
        slot.loop = make_lending_loop(setup, rows_.start(slot.row), options_);
        go_on(slot, lane, false);
    }

    /// Advances a run alone, until it may return to its lane or has ended.
    void go_on(Slot& slot, std::size_t lane, bool beyond)
    {
        if (slot.loop->go_to_quiet_steps(slot.quiet, beyond)) {
            auto& adapter = static_cast<typename Lanes::SystemAdapter&>(slot.parts->adapter());
            lanes_.load(lane, adapter, slot.loop->lend(), slot.quiet);
        } else {
            rows_.keep(slot.row, slot.loop->take());
        }
    }

    void serve(std::size_t lane)
    {
        Slot& slot = slots_[lane];
        rows_.attempt(slot.row, [&] {
            lanes_.store(lane, slot.quiet, true);
            slot.loop->take_back(slot.quiet);
            go_on(slot, lane, true);
        });
        fill(lane);
    }

    void finish_alone(std::size_t lane)
    {
        Slot& slot = slots_[lane];
        rows_.attempt(slot.row, [&] {
            lanes_.store(lane, slot.quiet, false);
            slot.loop->take_back(slot.quiet);
            rows_.keep(slot.row, slot.loop->take());
        });
    }

    Lanes& lanes_;
    Rows& rows_;
    const Options& options_;
    std::array<Slot, lane_count> slots_;
    std::size_t next_ = 0;  ///< next row to start
};

/// The rows of a table of starts.
/// @tparam SystemOf  function that returns the system of a row
template <class System, class X, class SystemOf, class Detector, class Locator>
class LaneRows {
    static_assert(has_flow_alone<System>());
    using Stepping = ErrorControlled<Taylor>;

public:
    using Parts = RunComponents<System, X, Stepping, Detector, Locator>;
    using Start = CoreState<X>;

    LaneRows(const SystemOf& system_of, const std::vector<X>& starts, const Stepping& stepping,
             const Detector& detector, const Locator& locator)
        : system_of_(system_of),
          starts_(starts),
          stepping_(stepping),
          detector_(detector),
          locator_(locator),
          results_(starts.size())
    {
    }

    [[nodiscard]] std::size_t count() const { return starts_.size(); }
    [[nodiscard]] Start start(std::size_t row) const { return core_state(starts_[row]); }
    void open(std::optional<Parts>& parts, std::size_t row) const
    {
        parts.emplace(system_of_(row), starts_[row], stepping_, detector_, locator_);
    }
    template <class Adapter>
    [[nodiscard]] static bool shares(const Adapter& adapter)
    {
        return adapter.as_compiled();
    }
    template <class Function>
    void attempt(std::size_t row, const Function& run)
    {
        results_.attempt(row, run);
    }
    void keep(std::size_t row, Run<Start>&& run)
    {
        results_.keep(row, as_callers<X>(std::move(run), starts_[row]));
    }
    [[nodiscard]] Ensemble<Run<X>> take() { return results_.take(); }

private:
    const SystemOf& system_of_;
    const std::vector<X>& starts_;
    const Stepping& stepping_;
    const Detector& detector_;
    const Locator& locator_;
    LaneResults<X> results_;
};

template <class System, class X, class SystemOf, class Detector, class Locator>
[[nodiscard]] Ensemble<Run<X>> run_in_lanes(const SystemOf& system_of, const std::vector<X>& starts,
                                            const Options& options,
                                            const ErrorControlled<Taylor>& stepping,
                                            const Detector& detector, const Locator& locator)
{
    if constexpr (fits_lanes<System, X>()) {
        const auto run = [&]<bool wide>(std::bool_constant<wide>) {
            LaneRows<System, X, SystemOf, Detector, Locator> rows(system_of, starts, stepping,
                                                                  detector, locator);
            TaylorLanes<System, X, wide> lanes(options,
                                               taylor_order(stepping.value.order, options.rtol));
            LaneRuns(lanes, rows, options).run();
            return rows.take();
        };
        if (!fuses_products()) {
            if constexpr (!lanes_are_wide) {
                if (!has_wide_lanes()) return run(std::false_type());
            }
            if constexpr (lanes_may_be_wide) return run(std::true_type());
        }
    }
    LaneResults<X> results(starts.size());
    for (std::size_t row = 0; row < starts.size(); ++row) {
        results.attempt(row, [&] {
            results.keep(
                row, integrate(system_of(row), starts[row], options, stepping, detector, locator));
        });
    }
    return results.take();
}

}  // namespace detail

/// Whether runs of such systems share their series. Other systems are integrated one run after the
/// other: those with modes, with a flow that is a polynomial in time, has more than thirty
/// operations or is no `UnrolledSeries`, with more than one guard, or with a guard without a
/// series.
template <class System, class X = typename System::State>
inline constexpr bool runs_in_lanes = detail::fits_lanes<System, X>();

/// Integrates `system` from each of `starts`, four runs at a time. Row i has the bits of
/// `integrate(system, starts[i], options, stepping, detector, locator)`, events and statistics
/// included. Where that would throw, the row is empty and `failures` has the exception.
///
/// A run shares a lane while it takes steps without events. It is computed alone around events,
/// until the last of its `sample_times`, with `Options::record_steps`, with a detector other than
/// `Extremum` and `Bernstein`, and with one that does not examine every step. Where the compiler
/// may fuse products and sums (as g++ does with -march=native, but not with -ffp-contract=off) all
/// runs are computed alone, since their bits would differ. For several threads, give blocks of
/// starts to `ensemble`.
///
/// @param options  for all runs; runs ended by `cancelled` have that outcome
template <class System, class X = typename System::State, class Detector = Extremum,
          class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] Ensemble<Run<X>> integrate_lanes(const System& system, const std::vector<X>& starts,
                                               const Options& options,
                                               const ErrorControlled<Taylor>& stepping = {},
                                               const Detector& detector = {},
                                               const Locator& locator = {})
{
    const auto same = [&](std::size_t) -> const System& { return system; };
    return detail::run_in_lanes<System>(same, starts, options, stepping, detector, locator);
}

/// The same with a system for each start, such as one of other parameters.
/// @throws std::invalid_argument unless there are as many systems as starts
template <class System, class X = typename System::State, class Detector = Extremum,
          class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] Ensemble<Run<X>> integrate_lanes(const std::vector<System>& systems,
                                               const std::vector<X>& starts, const Options& options,
                                               const ErrorControlled<Taylor>& stepping = {},
                                               const Detector& detector = {},
                                               const Locator& locator = {})
{
    if (systems.size() != starts.size()) {
        throw std::invalid_argument("integrate_lanes: expected a system for each start, got " +
                                    std::to_string(systems.size()) + " systems and " +
                                    std::to_string(starts.size()) + " starts");
    }
    const auto own = [&](std::size_t row) -> const System& { return systems[row]; };
    return detail::run_in_lanes<System>(own, starts, options, stepping, detector, locator);
}

}  // namespace ricochet
