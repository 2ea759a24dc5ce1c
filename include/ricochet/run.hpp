// A run: how it ended, its counts, its events and its solution, and the snapshot from which one
// goes on.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/options.hpp"
#include "ricochet/phase.hpp"

namespace ricochet {

namespace detail {
[[noreturn]] void throw_no_solution(bool no_steps);
}

// Outcomes of runs.

/// How a run or a motion ended.
enum class Outcome {
    reached_end,
    stopped_by_event,
    zeno,  ///< events accumulate, or a motion presses on its guard, and no rest rule stops it
    outside_mode,          ///< a reset left the state behind a unilateral guard
    endless_cascade,       ///< resets kept triggering each other at one instant
    conflicting_resets,    ///< two resets of one set, or a reset and a time event's, gave one
                           ///< component different values
    unknown_mode,          ///< a reset returned a mode that the system does not have
    step_underflow,        ///< no step above h_min met the tolerance
    step_limit,            ///< `Options::max_steps` steps were taken
    non_finite,            ///< the flow, a guard or a reset returned NaN or infinity
    cancelled,             ///< by `Options::cancelled`, or by `finish()` before the end
    wrong_bound,           ///< a guard broke a bound that the system declares for it
    not_converged,         ///< a set-valued stage could not be solved however short the step
    time_event_not_ahead,  ///< `next_time_event(t)` returned a time that is not after t
    wrong_dimension,       ///< the flow or a reset left a state of another dimension
    stalled,               ///< steps hardly advanced the time, or an endless run met no end
    stopped_by_callback,   ///< a function of the system reported an error, see `ricochet.h`
    at_rest,               ///< of a fault: nothing moves or will move again; the end is reached
    not_handed_over,       ///< a set-valued phase was due, with `HandOverOptions::events_only`, or
                           ///< no reaction within its bounds goes with y there
    released,              ///< no reaction is held any more, with `HandOverOptions::until_released`
    law_violated,          ///< a set-valued step ended with a reaction that contradicts its y, or
                           ///< the flow is another one than that of the inclusion which takes over
    several,               ///< several motions satisfy the law of the reactions at one state
    running,               ///< only of a set-valued motion: it has not ended yet
};

/// The enumerator's name, e.g. "reached_end".
[[nodiscard]] std::string_view name(Outcome outcome) noexcept;

/// One sentence with the remedy, e.g. "step fell below h_min; loosen rtol".
[[nodiscard]] std::string_view describe(Outcome outcome) noexcept;

// Counts over a run.

/// Reason for which a step was taken to hold no event.
enum class Evidence : std::uint8_t {
    proved,   ///< a bound or polynomial excludes a root
    checked,  ///< evaluated at the ends and at the interior extremum
    gated,    ///< a calibrated network skipped the check, within its miss rate
    assumed,  ///< evaluated at the ends only, or predicted by a bare network
};

/// How many steps were taken to be free of events, and on what evidence.
struct EvidenceCounts {
    std::uint64_t proved = 0;
    std::uint64_t checked = 0;
    std::uint64_t gated = 0;
    std::uint64_t assumed = 0;

    constexpr void add(Evidence evidence) noexcept
    {
        switch (evidence) {
            case Evidence::proved: ++proved; return;
            case Evidence::checked: ++checked; return;
            case Evidence::gated: ++gated; return;
            case Evidence::assumed: ++assumed; return;
        }
    }
};

/// Counts over one run.
struct Statistics {
    std::uint64_t steps = 0;             ///< accepted steps, including those cut short by an event
    std::uint64_t rejected = 0;          ///< steps that failed the error test
    std::uint64_t refined_steps = 0;     ///< steps divided for a guard that they did not resolve
    std::uint64_t unresolved_steps = 0;  ///< refined steps that the finest division did not resolve
    std::uint64_t resteps = 0;           ///< steps repeated from their start to locate an event
    std::uint64_t flow_calls = 0;        ///< evaluations of the flow, for all purposes
    std::uint64_t guard_calls = 0;       ///< evaluations of the guard, for all purposes
    std::uint64_t network_calls = 0;     ///< evaluations of a network
    std::uint64_t false_alarms = 0;      ///< a network predicted an event and there was none
    std::uint64_t missed_events = 0;     ///< events in a step that a network had cleared
    std::uint64_t late_events = 0;       ///< missed events that only a later step found
    std::uint64_t checks_deferred =
        0;  ///< steps whose exact check a network or a plan deferred for good
    std::uint64_t outside_domain = 0;  ///< states outside the box of a gate: checked exactly
    /// Evaluations of `lower_bound` and `upper_bound`, and enclosures of guards along intervals.
    std::uint64_t bound_calls = 0;
    std::uint64_t rollbacks = 0;       ///< returns to the start of a step that could not be closed
    std::uint64_t repeated_steps = 0;  ///< steps taken again because of that
    std::uint64_t events = 0;
    std::uint64_t suppressed = 0;  ///< repeats of an event inside its own window
    std::uint64_t disabled = 0;    ///< crossings that `enabled` rejected
    /// Events at which no state was found that has left the guard's side in floating point.
    std::uint64_t unmet_conditions = 0;
    /// Events whose reset returned its mode and left the state alone, with a mode also when it was
    /// asked again beyond the surface.
    std::uint64_t ineffective_resets = 0;
    /// The guard of the last of them in a system with modes, whose reset was asked twice.
    std::size_t declined_guard = no_guard;
    /// Events of guards with `Crossing::either` from which another mode turns the motion back. A
    /// guard with a direction would fire again there.
    std::uint64_t either_relays = 0;
    std::size_t relay_guard = no_guard;  ///< the guard of the last of them
    /// State-changing or terminal guards that were beyond their surface where they were armed, or
    /// on it with a motion that goes beyond: at the start, or by a mode that enabled them. They
    /// wait until they have returned.
    std::uint64_t armed_beyond = 0;
    EvidenceCounts evidence;
};

/// Describes what an outcome does not say, in a sentence each: resets that declined, and relays by
/// guards with `Crossing::either`. Empty if there are none.
/// @param guard_names  what the guards are called; others go by their numbers
[[nodiscard]] std::string describe(const Statistics& statistics,
                                   std::span<const std::string> guard_names = {});

// The whole solution, for evaluation at any time after the run.

/// Steps as polynomials, of the order that the method attains over many steps. Where
/// the state jumps there is one value on each side.
template <class State>
class Solution {
public:
    [[nodiscard]] bool empty() const noexcept { return pieces_.empty(); }
    [[nodiscard]] std::size_t size() const noexcept { return pieces_.size(); }

    /// x at time t [s], after an event at t. Before the first and after the last
    /// recorded step, the nearest computed state.
    /// @throws std::invalid_argument, as do `before` and `mode`, if no step has been recorded, as
    /// without `Options::record_steps`, and for a time that is NaN.
    [[nodiscard]] State operator()(double t) const { return evaluate(pieces_[after(t)], t); }

    /// x at time t [s], before an event at t.
    [[nodiscard]] State before(double t) const
    {
        std::size_t k = after(t);
        while (k > 0 && offset(pieces_[k], t) <= 0) --k;
        return evaluate(pieces_[k], t);
    }

    /// The mode at time t [s], after an event at t.
    [[nodiscard]] Mode mode(double t) const { return pieces_[after(t)].mode; }

    /// Time [s] at which step k starts; for k = size(), at which the last one ends. Needs a step.
    [[nodiscard]] double time(std::size_t k) const
    {
        if (k < pieces_.size()) return pieces_[k].t;
        const Piece& last = pieces_.back();
        return last.backward ? last.t - last.length : last.t + last.length;
    }

    /// Passes every number to `visit`, which writes it or replaces it by the number that it reads
    /// (`detail::SnapshotWriter`, `detail::SnapshotReader`).
    template <class Visitor>
    void visit(Visitor&& visit)
    {
        std::size_t size = pieces_.size();
        visit(size);
        pieces_.resize(size);
        for (Piece& piece : pieces_) {
            for (double* number : {&piece.t, &piece.length, &piece.h}) visit(*number);
            auto nodes = static_cast<std::uint8_t>(piece.nodes);
            visit(piece.backward);
            visit(piece.mode);
            visit(nodes);
            visit(piece.departures);
            visit(piece.slopes);
            piece.nodes = static_cast<detail::DenseNodes>(nodes);
            piece.departures = detail::least_of<std::size_t>(piece.departures, 3);
            piece.slopes = detail::least_of(piece.slopes, piece.departures);
            for (State* x : {&piece.x0, &piece.remainder, &piece.rate0}) visit.state(*x);
            for (std::size_t k = 0; k < piece.departures; ++k) visit.state(piece.w[k]);
            for (std::size_t k = 0; k < piece.slopes; ++k) visit.state(piece.slope[k]);
            if (piece.nodes == detail::DenseNodes::series) {
                std::size_t numbers = piece.series.size();
                visit(numbers);
                piece.series.resize(numbers);
                for (double& number : piece.series) visit(number);
            }
            visit(piece.end_time);
            if (piece.end_time == piece.end_time) visit.state(piece.end);
        }
    }

    /// Adds a step, of which only the first `length` [s] were used.
    void add(double t0, bool backward, Mode mode, const detail::DenseParts<State>& parts,
             double length)
    {
        Piece piece{.t = t0,
                    .length = length,
                    .h = parts.h,
                    .backward = backward,
                    .mode = mode,
                    .nodes = parts.nodes,
                    .x0 = *parts.x0,
                    .remainder = *parts.remainder,
                    .rate0 = *parts.rate0};
        for (std::size_t k = 0; k < 3; ++k) {
            if (parts.w[k]) piece.w[piece.departures++] = *parts.w[k];
            if (parts.w[k] && parts.slope[k]) piece.slope[piece.slopes++] = *parts.slope[k];
        }
        if (parts.nodes == detail::DenseNodes::series) {
            const double* const first = parts.series.coefficients;
            const auto orders = static_cast<std::size_t>(parts.series.order) + 1;
            piece.series.assign(first, first + orders * parts.series.stride);
        }
        pieces_.push_back(std::move(piece));
    }

    /// Adds the steps of `from`, with states of another type, that are not yet in this solution.
    template <class Other, class Convert>
    void add_from(const Solution<Other>& from, const Convert& convert)
    {
        const auto all = [&](const std::array<Other, 3>& states, std::size_t count) {
            std::array<State, 3> out{};
            for (std::size_t k = 0; k < count; ++k) out[k] = convert(states[k]);
            return out;
        };
        if (pieces_.empty()) pieces_.reserve(from.pieces_.size());
        for (std::size_t i = pieces_.size(); i < from.pieces_.size(); ++i) {
            const auto& piece = from.pieces_[i];
            pieces_.push_back(
                {.t = piece.t,
                 .length = piece.length,
                 .h = piece.h,
                 .backward = piece.backward,
                 .mode = piece.mode,
                 .nodes = piece.nodes,
                 .x0 = convert(piece.x0),
                 .remainder = convert(piece.remainder),
                 .rate0 = convert(piece.rate0),
                 .departures = piece.departures,
                 .slopes = piece.slopes,
                 .w = all(piece.w, piece.departures),
                 .slope = all(piece.slope, piece.slopes),
                 .series = piece.series,
                 .end_time = piece.end_time,
                 .end = piece.end_time == piece.end_time ? convert(piece.end) : State{}});
        }
    }

    /// Declares x the state before an event at time t, at which the last step ends.
    void end_at(double t, const State& x)
    {
        pieces_.back().end = x;
        pieces_.back().end_time = t;
    }

    /// Drops what lies after time t.
    void cut(double t)
    {
        while (!pieces_.empty() && offset(pieces_.back(), t) <= 0) pieces_.pop_back();
        if (pieces_.empty()) return;
        Piece& last = pieces_.back();
        last.length = detail::least_of(last.length, offset(last, t));
    }

    /// Keeps only the first `size` steps.
    void shrink(std::size_t size)
    {
        pieces_.erase(pieces_.begin() + static_cast<std::ptrdiff_t>(size), pieces_.end());
    }

private:
    template <class>
    friend class Solution;

    struct Piece {
        double t, length, h;
        bool backward;
        Mode mode;
        detail::DenseNodes nodes;
        State x0, remainder, rate0;
        std::size_t departures = 0, slopes = 0;  ///< numbers of `w` and `slope`
        std::array<State, 3> w{}, slope{};
        std::vector<double> series{};
        double end_time = std::numeric_limits<double>::quiet_NaN();  ///< [s] of `end`
        State end{};  ///< the state before an event, as its reset has seen it
    };

    [[nodiscard]] static double offset(const Piece& piece, double t) noexcept
    {
        return piece.backward ? piece.t - t : t - piece.t;
    }

    /// The last piece that starts at or before t.
    [[nodiscard]] std::size_t after(double t) const
    {
        if (pieces_.empty() || t != t) detail::throw_no_solution(pieces_.empty());
        std::size_t first = 0, end = pieces_.size();
        while (end - first > 1) {
            const std::size_t middle = first + (end - first) / 2;
            (offset(pieces_[middle], t) < 0 ? end : first) = middle;
        }
        return first;
    }

    [[nodiscard]] static State evaluate(const Piece& piece, double t)
    {
        if (offset(piece, t) >= offset(piece, piece.end_time)) return piece.end;
        detail::DenseParts<State> parts{.nodes = piece.nodes,
                                        .h = piece.h,
                                        .x0 = &piece.x0,
                                        .remainder = &piece.remainder,
                                        .rate0 = &piece.rate0};
        const std::size_t without_slope = piece.departures - piece.slopes;
        for (std::size_t k = 0; k < piece.departures; ++k) {
            parts.w[k] = &piece.w[k];
            if (k >= without_slope) parts.slope[k] = &piece.slope[k - without_slope];
        }
        State x = piece.x0;
        if (const auto n = static_cast<std::size_t>(x.size()); piece.series.size() >= 2 * n) {
            parts.series = {piece.series.data(), static_cast<int>(piece.series.size() / n) - 1, n};
        }
        const double s = detail::least_of(detail::greatest_of(offset(piece, t), 0.0), piece.length);
        if (s > 0) {
            const detail::DenseView<State, false> view(parts, s);
            detail::for_each_component(x, [&](auto i) { x[i] = view[i]; });
        }
        return x;
    }

    std::vector<Piece> pieces_;
};

// Result of a run. Everything that was computed is returned: whatever the outcome,
// it holds the time, the state and the events up to the end of the run.

/// States at chosen times.
template <class State>
struct Trajectory {
    std::vector<double> t;  ///< [s]
    std::vector<State> x;
};

/// A guard that violated a bound that its system declares.
template <class State>
struct WrongBound {
    std::size_t guard = no_guard;
    bool lower_bound = false;  ///< the guard lies below it
    bool upper_bound = false;  ///< the guard lies above it; neither: it changed too fast
    double t = 0;              ///< [s] time at which the violation was found
    State x{};                 ///< state at that time
    double value = 0;          ///< value of the guard there
    double since = 0;          ///< [s] time of its last check; t for a bound on the value
    double value_then = 0;     ///< value of the guard at that check, or the bound that stood for it
    double allowed = 0;        ///< the bound, or the largest change allowed since that check
};

/// Result of a run: why, when and where it ended, and everything computed until then, whatever the
/// outcome.
template <class State>
struct Run {
    Outcome outcome = Outcome::reached_end;
    double t = 0;  ///< [s] time reached
    State x{};     ///< state at that time
    Mode mode = 0;
    /// The guard that ended the run, or `no_guard` if none did. `other_guard` is the second of two
    /// conflicting resets, `time_event_reset` for that of a time event, or, with `zeno`, another
    /// guard of the cycle that accumulates.
    std::size_t guard = no_guard;
    std::size_t other_guard = no_guard;
    /// Text of the `StopRun` that ended the run; of `non_finite` the function that was not finite.
    std::string reason;
    std::vector<std::size_t> armed_beyond;  ///< guards that `Statistics::armed_beyond` counts
    /// Those of them that lay on their surface, where the motion went on beyond it.
    std::vector<std::size_t> armed_on_surface;
    std::vector<Event<State>> events;
    Trajectory<State> trajectory;  ///< empty unless `Options::sample_times` were given
    Solution<State> solution;      ///< empty without `Options::record_steps`
    std::optional<WrongBound<State>> wrong_bound;  ///< set with `Outcome::wrong_bound`
    Statistics statistics;                         ///< of all steps

    // Of a system with set_valued() (nonsmooth/hand_over.hpp), else empty.

    std::vector<MotionPhase> phases;  ///< where something is held, or followed by implicit steps
    SetValuedStatistics set_valued;   ///< of the implicit steps alone
    StageReport failure;  ///< with `not_converged`: the residual, and whose law or set failed
    /// The reactions at the end of a run that has ended by itself, after its events: empty where
    /// the mode has no inclusion, NaN where none follows from the state.
    std::vector<double> reaction;
    std::vector<std::vector<double>> reactions;  ///< the same at the sample times
};

namespace detail {

[[nodiscard]] std::string describe_reason(Outcome outcome, const std::string& reason);
[[nodiscard]] std::string describe_run(Outcome outcome, const std::string& reason,
                                       const std::vector<std::size_t>& armed_beyond,
                                       const std::vector<std::size_t>& armed_on_surface);

}  // namespace detail

/// A sentence about the outcome, with the text of the reset that has ended the run, and one about
/// guards that were armed beyond their surface, or on it.
template <class State>
[[nodiscard]] std::string describe(const Run<State>& run)
{
    return detail::describe_run(run.outcome, run.reason, run.armed_beyond, run.armed_on_surface);
}

// A saved run: everything that its future depends on, as numbers, and the identity of the run.

/// A property, as text, in which a run must agree with the run that was saved in order to continue
/// it: {"method", "FixedStep<Euler>"}, {"rtol", "1e-08"}.
struct RunProperty {
    std::string name;
    std::string value;

    [[nodiscard]] bool operator==(const RunProperty&) const = default;
};

/// State of a simulation, as `Simulation::save` returns it: real numbers and other values, in the
/// order in which the simulation lists them.
struct Snapshot {
    std::vector<RunProperty> run;  ///< properties of the run that was saved
    std::vector<double> numbers;
    std::vector<std::uint64_t> counts;

    [[nodiscard]] bool operator==(const Snapshot&) const = default;
};

/// The snapshot as text, its numbers in hexadecimal so that no bit is lost, with a checksum.
[[nodiscard]] std::string to_text(const Snapshot& snapshot);

/// @throws std::invalid_argument if `text` is not exactly what `to_text` has written.
[[nodiscard]] Snapshot snapshot_from_text(std::string_view text);

namespace detail {

/// Makes room for one event more, without much memory where there are few.
template <class State>
void make_room(std::vector<Event<State>>& events)
{
    if (events.size() < events.capacity() || events.size() > 4) return;
    events.reserve(events.empty() ? 4 : 16);
}

/// @throws std::invalid_argument because the snapshot does not fit the simulation.
[[noreturn]] void throw_snapshot_does_not_fit();
/// @throws std::invalid_argument because `what` has a value that no run gives it.
[[noreturn]] void throw_snapshot_is_no_state(std::string_view what);

/// @throws std::invalid_argument because the snapshot was taken after the end of the run.
[[noreturn]] void throw_snapshot_later(double t, double t_end);

/// Text that contains the name of a type as the compiler writes it.
template <class T>
[[nodiscard]] constexpr const char* written_type() noexcept
{
    return __PRETTY_FUNCTION__;
}

/// Name of a type without namespaces, the same from every compiler: `Planned<Extremum>`.
[[nodiscard]] std::string plain_type_name(std::string_view written);

/// The name that a system declares, or else the name of its type.
template <class System>
[[nodiscard]] std::string name_of_system(const System& system)
{
    if constexpr (requires {
                      {
                          system.name
                          } -> std::convertible_to<std::string_view>;
                  }) {
        return std::string(std::string_view(system.name));
    } else {
        return plain_type_name(written_type<System>());
    }
}

/// Parts of a run, identified by name.
struct RunParts {
    std::string system;
    std::string stepping, detector, locator;
    std::size_t components = 0;  ///< number of components of the state at the start
    std::size_t guards = 0;
    bool error_controlled = false;
};

[[nodiscard]] std::vector<RunProperty> properties_of_run(const RunParts& parts,
                                                         const Options& options);
/// @throws std::invalid_argument naming the first property that is not the same in both.
void require_same_run(const std::vector<RunProperty>& saved, const std::vector<RunProperty>& here);

/// Whether a flag, a count or an enumerator can have this value.
[[nodiscard]] constexpr bool may_be(Side, std::uint64_t value) noexcept
{
    return value <= static_cast<std::uint64_t>(Side::above);
}
[[nodiscard]] inline bool may_be(Outcome, std::uint64_t value) noexcept
{
    return value < 256 && name(static_cast<Outcome>(value)) != "unknown";
}
template <std::unsigned_integral T>
[[nodiscard]] constexpr bool may_be(T, std::uint64_t value) noexcept
{
    return value <= std::numeric_limits<T>::max();
}

class SnapshotWriter {
public:
    static constexpr bool saves = true;

    explicit SnapshotWriter(Snapshot& snapshot) noexcept : snapshot_(&snapshot) {}

    template <class T>
    void operator()(const T& value)
    {
        if constexpr (std::is_floating_point_v<T>) {
            snapshot_->numbers.push_back(value);
        } else {
            snapshot_->counts.push_back(static_cast<std::uint64_t>(value));
        }
    }

    template <class X>
    void state(const X& x)
    {
        (*this)(static_cast<std::size_t>(x.size()));
        for (decltype(x.size()) i = 0; i < x.size(); ++i) snapshot_->numbers.push_back(x[i]);
    }

private:
    Snapshot* snapshot_;
};

class SnapshotReader {
public:
    static constexpr bool saves = false;

    explicit SnapshotReader(const Snapshot& snapshot) noexcept : snapshot_(&snapshot) {}

    template <class T>
    void operator()(T& value)
    {
        if constexpr (std::is_floating_point_v<T>) {
            if (number_ == snapshot_->numbers.size()) throw_snapshot_does_not_fit();
            value = snapshot_->numbers[number_++];
        } else {
            if (count_ == snapshot_->counts.size()) throw_snapshot_does_not_fit();
            const std::uint64_t count = snapshot_->counts[count_++];
            if (!may_be(T{}, count)) throw_snapshot_is_no_state("a flag or a count");
            value = static_cast<T>(count);
        }
    }

    template <class X>
    void state(X& x)
    {
        std::size_t size = 0;
        (*this)(size);
        if (snapshot_->numbers.size() - number_ < size) throw_snapshot_does_not_fit();
        if constexpr (requires { x.resize(0); }) {
            x.resize(static_cast<decltype(x.size())>(size));
        } else {
            if (size != static_cast<std::size_t>(x.size())) throw_snapshot_does_not_fit();
        }
        for (decltype(x.size()) i = 0; i < x.size(); ++i) (*this)(x[i]);
    }

    /// Checks that everything has been read.
    void finish() const
    {
        if (number_ != snapshot_->numbers.size() || count_ != snapshot_->counts.size()) {
            throw_snapshot_does_not_fit();
        }
    }

private:
    const Snapshot* snapshot_;
    std::size_t number_ = 0;
    std::size_t count_ = 0;
};

}  // namespace detail

}  // namespace ricochet
