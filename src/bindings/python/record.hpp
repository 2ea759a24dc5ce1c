// Results of a run, as memory that NumPy can view without a copy.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "request.hpp"
#include "ricochet/run.hpp"

namespace ricochet::python {

/// One event up to its states, which follow it: `before`, then `after`, each of as many doubles
/// as the widest state of the run has.
struct EventHead {
    double t;
    std::int64_t guard;  ///< -1 if there is none
    double bracket[2];
    double slope;
    double error;
    std::uint32_t mode_before;
    std::uint32_t mode_after;
    std::uint8_t kind;
    bool late;
    std::uint8_t unused[2];
    std::int32_t reaction;  ///< -1 if there is none
};
static_assert(sizeof(EventHead) == 64);

/// What a run with contacts did in contact, see `ContactStatistics` and `ContactReport`.
struct ContactCounts {
    std::uint64_t steps = 0, problems = 0, iterations = 0, sweeps = 0, unsolved = 0;
    std::uint64_t to_contact = 0, to_flight = 0;
    double time = 0;      ///< [s]
    bool failed = false;  ///< the run ended where a contact problem was not solved:
    int contact = -1;
    double residual = 0;
};

struct Record {
    Outcome outcome = Outcome::reached_end;
    double t = 0;
    std::vector<double> x;
    Mode mode = 0;
    std::int64_t guard = -1;
    std::int64_t other_guard = -1;
    Statistics statistics;
    std::uint64_t jacobians = 0;  ///< of an implicit method
    std::uint64_t factorizations = 0;
    std::size_t width = 0;  ///< components of the widest state; narrower ones end in NaN
    std::size_t event_count = 0;
    std::vector<double> events;  ///< heads with their states, in units of 8 bytes
    std::vector<double> times;
    std::vector<double> states;                 ///< row after row of `width`
    std::shared_ptr<Solution<State>> solution;  ///< null if it was not kept
    std::string wrong_bound;                    ///< sentence about a violated bound
    std::string reason;                         ///< text of the `Stop` that ended the run
    std::vector<std::size_t> armed_beyond;      ///< guards that began beyond their surface,
    std::vector<std::size_t> armed_on_surface;  ///< and those of them that began on it
    std::vector<MotionPhase> phases;            ///< of a system with set-valued motion
    std::vector<double> reaction;
    std::size_t reaction_width = 0;        ///< number of reactions in the widest row
    std::vector<double> reactions;         ///< row after row of that width, one for each of `times`
    std::optional<ContactCounts> contact;  ///< of a mechanism

    [[nodiscard]] std::size_t event_stride() const noexcept
    {
        return sizeof(EventHead) / sizeof(double) + 2 * width;
    }
};

/// States at the ends of steps, and their reactions where the system has set-valued motion.
template <class X>
struct StepEnds {
    Trajectory<X> states;
    std::vector<std::vector<double>> reactions;
};

/// Writes x to `out`, and NaN up to `width`.
template <class X>
void put_state(const X& x, std::size_t width, double* out)
{
    for (std::size_t i = 0; i < width; ++i) {
        out[i] = i < x.size() ? x[i] : std::numeric_limits<double>::quiet_NaN();
    }
}

/// Rows one after the other in `out`, narrower ones with NaN behind; returns their width.
[[nodiscard]] inline std::size_t put_rows(const std::vector<std::vector<double>>& rows,
                                          std::vector<double>& out)
{
    std::size_t width = 0;
    for (const auto& row : rows) width = std::max(width, row.size());
    out.resize(rows.size() * width);
    for (std::size_t i = 0; i < rows.size(); ++i) put_state(rows[i], width, out.data() + i * width);
    return width;
}

[[nodiscard]] inline std::int64_t signed_guard(std::size_t guard) noexcept
{
    return static_cast<std::int64_t>(guard);
}

/// Writes the events with their states, which are not wider than `out.width`.
template <class X>
void put_events(const std::vector<Event<X>>& events, Record& out)
{
    out.event_count = events.size();
    out.events.resize(out.event_count * out.event_stride());
    double* at = out.events.data();
    for (const Event<X>& event : events) {
        const EventHead head{.t = event.t,
                             .guard = signed_guard(event.guard),
                             .bracket = {event.bracket.lo, event.bracket.hi},
                             .slope = event.slope,
                             .error = event.error,
                             .mode_before = event.mode_before,
                             .mode_after = event.mode_after,
                             .kind = static_cast<std::uint8_t>(event.kind),
                             .late = event.late,
                             .unused = {},
                             .reaction = static_cast<std::int32_t>(event.reaction)};
        std::memcpy(at, &head, sizeof head);
        double* states = at + sizeof(EventHead) / sizeof(double);
        put_state(event.before, out.width, states);
        put_state(event.after, out.width, states + out.width);
        at += out.event_stride();
    }
}

/// A sentence about a bound that a guard has broken.
template <class X>
[[nodiscard]] std::string text_of(const WrongBound<X>& wrong)
{
    return "at t = " + std::to_string(wrong.t) + " the guard is " + std::to_string(wrong.value) +
           ", and " +
           (wrong.lower_bound   ? "its lower bound "
            : wrong.upper_bound ? "its upper bound "
                                : "it may have changed by ") +
           std::to_string(wrong.allowed);
}

/// @param steps  ends of steps, if they are to be kept; null: the samples of the trajectory are
/// used
template <class X>
[[nodiscard]] Record record_of(Run<X>&& run, const StepEnds<X>* steps = nullptr)
{
    Record out;
    const Trajectory<X>& kept = steps ? steps->states : run.trajectory;
    out.outcome = run.outcome;
    out.t = run.t;
    out.width = run.x.size();
    for (const Event<X>& event : run.events) {
        out.width = std::max({out.width, event.before.size(), event.after.size()});
    }
    for (const X& x : kept.x) out.width = std::max(out.width, x.size());
    out.x.assign(run.x.begin(), run.x.end());
    out.mode = run.mode;
    out.guard = signed_guard(run.guard);
    out.other_guard = signed_guard(run.other_guard);
    out.statistics = run.statistics;
    out.reason = run.reason;
    out.armed_beyond = run.armed_beyond;
    out.armed_on_surface = run.armed_on_surface;
    out.phases = run.phases;
    out.reaction = run.reaction;
    out.reaction_width = put_rows(steps ? steps->reactions : run.reactions, out.reactions);
    put_events(run.events, out);
    out.times = kept.t;
    out.states.resize(kept.x.size() * out.width);
    for (std::size_t i = 0; i < kept.x.size(); ++i) {
        put_state(kept.x[i], out.width, out.states.data() + i * out.width);
    }
    if constexpr (std::is_same_v<X, State>) {
        if (!run.solution.empty()) {
            out.solution = std::make_shared<Solution<State>>(std::move(run.solution));
        }
    }
    if (run.wrong_bound) out.wrong_bound = text_of(*run.wrong_bound);
    return out;
}

}  // namespace ricochet::python
