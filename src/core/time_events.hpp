// The next time event of a system: of its list, or of a timer in its state.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/step.hpp"
#include "ricochet/detail/system_table.hpp"

namespace ricochet::detail {

template <class X>
class TimeEvents {
public:
    /// Reason for which a time event is asked for.
    enum class After : std::uint8_t { start, restart, set, time_event };

    /// @param continues  the run goes on where another one has ended, which had the events there
    TimeEvents(const SystemAt<X>& system, bool backward, bool continues) noexcept
        : system_(system), backward_(backward), continues_(continues)
    {
    }

    /// Time [s] of the next one; infinity: there is none.
    [[nodiscard]] double next() const noexcept { return next_; }
    /// Puts back the time of the next one, as it was at the start of a step.
    void put_back(double next) noexcept
    {
        next_ = next;
        forget_here();
    }
    /// Whether one is due at the start of the step.
    [[nodiscard]] bool is_due_here() const noexcept { return due_here_; }
    /// Whether the last one was at time t [s].
    [[nodiscard]] bool was_at(double t) const noexcept { return passed_ == t; }

    /// Finds the next one at the start of the step. One of a timer in the state, or of a list, may
    /// be due there. Any other has to lie ahead: false if it does not, since it would be lost, with
    /// all that follow it.
    /// @param window  [s] length of the window of simultaneous events there
    [[nodiscard]] bool find(After what, const Step<X>& step, double window)
    {
        const double t = step.start().value;
        if (!backward_) {
            next_ = system_->next_time_event_at
                        ? system_->next_time_event_at(system_.adapter(), step.mode(), t, step.x0())
                        : system_->next_time_event(system_.adapter(), t);
        } else if (system_->previous_time_event) {
            next_ = system_->previous_time_event(system_.adapter(), t);
        }
        due_here_ = finds_due(what, t, step.until(next_), window);
        if (due_here_) next_ = t;
        assert(!due_here_ || next_ == t);
        return due_here_ || step.until(next_) > 0;
    }

    /// Has the time event at t [s].
    void pass(double t) noexcept { passed_ = t; }
    /// Takes notice of a set: a timer idles if the last time event of its instant, and what has
    /// followed it there, `changes` nothing.
    void see_set(bool changes, bool on_time, bool located) noexcept
    {
        idles_ = !changes && (on_time || (idles_ && !located));
    }

    /// Forgets what was due where the run stood.
    void forget_here() noexcept
    {
        due_here_ = false;
        listed_at_ = never;
    }
    /// Forgets all but the time of the next one.
    void forget() noexcept
    {
        forget_here();
        idles_ = false;
        passed_ = never;
    }

    template <class Visit>
    void visit(Visit&& visit)
    {
        visit(next_);
    }

private:
    static constexpr double never = std::numeric_limits<double>::quiet_NaN();

    [[nodiscard]] bool finds_due(After what, double t, double ahead, double window)
    {
        if (system_->time_event_count) {
            if (listed_at_ != t) {
                listed_at_ = t;
                const bool is_past = what == After::restart || (what == After::start && continues_);
                listed_left_ = is_past ? 0 : system_->time_event_count(system_.adapter(), t);
            }
            if (what == After::time_event && listed_left_ > 0) --listed_left_;
            return listed_left_ > 0;
        }
        // A timer that has had its event has been moved on, also by an earlier run: if it is at t,
        // or within the window before t, its event is still due.
        if (backward_ || !system_->next_time_event_at || idles_) return false;
        return next_ == t || (ahead <= 0 && -ahead <= window);
    }

    const SystemAt<X>& system_;
    bool backward_, continues_;
    double next_ = std::numeric_limits<double>::infinity();
    double passed_ = never;
    double listed_at_ = never;     ///< [s] where those of a list were counted,
    std::size_t listed_left_ = 0;  ///< and how many of them are still to come
    bool due_here_ = false;
    bool idles_ = false;  ///< the last time event of this instant changed nothing
};

}  // namespace ricochet::detail
