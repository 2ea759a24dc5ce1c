// A system whose functions are a C program's.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bindings/c/error.hpp"
#include "bindings/c/inclusion.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/ricochet.h"
#include "ricochet/system.hpp"

namespace ricochet::c {

[[noreturn]] void throw_callback_failed(const char* callback, int code, std::size_t guard,
                                        double t);

/// What rc_stop returns.
inline constexpr int stop_code = -0x53544f50;

/// The text of the call of rc_stop whose result a callback of this thread has returned.
/// @throws StopRun if there was one, with the mode after the event
void end_run_if_asked(int code, Mode mode);

/// Checks the return value of a callback, and throws CallbackFailed unless it is 0.
[[gnu::always_inline]] inline void heed(int code, const char* callback, double t,
                                        std::size_t guard = RC_NO_GUARD)
{
    if (code != 0) [[unlikely]] {
        throw_callback_failed(callback, code, guard, t);
    }
}

/// Callbacks under the names that the library calls. A callback that the program has not given must
/// not be called; the table for the loop omits it.
///
/// @throws CallbackFailed from every function whose callback returns a number other than 0.
class CallbackSystem {
public:
    static constexpr bool unchecked_names = true;

    /// @throws Refusal naming the invalid field.
    explicit CallbackSystem(const rc_callbacks& given);
    CallbackSystem(const CallbackSystem&) = delete;
    CallbackSystem& operator=(const CallbackSystem&) = delete;

    [[nodiscard]] const rc_callbacks& callbacks() const noexcept { return at_; }
    [[nodiscard]] std::size_t dimension() const noexcept { return at_.dimension; }
    [[nodiscard]] std::size_t guard_count() const noexcept { return at_.guard_count; }
    /// Number of modes; 1 for a system without modes.
    [[nodiscard]] std::size_t mode_count() const noexcept
    {
        return std::max<std::size_t>(at_.mode_count, 1);
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const noexcept { return infos_[which]; }

    template <class X>
    [[gnu::always_inline]] void flow(Mode mode, double t, const X& x, X& dxdt) const
    {
        heed(at_.flow(at_.user, mode, t, x.data(), dxdt.data(), x.size()), "flow", t);
    }

    template <class X>
    void guards(Mode mode, double t, const X& x, std::span<double> g) const
    {
        if (at_.guards) {
            heed(at_.guards(at_.user, mode, t, x.data(), x.size(), g.data(), g.size()), "guards",
                 t);
        } else {
            for (std::size_t i = 0; i < g.size(); ++i) g[i] = guard(i, mode, t, x);
        }
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const X& x) const
    {
        double g = nan;
        heed(at_.guard(at_.user, which, mode, t, x.data(), x.size(), &g), "guard", t, which);
        return g;
    }
    template <class X>
    void guard_rates(Mode mode, double t, const X& x, const X& dxdt, std::span<double> rates) const
    {
        heed(at_.guard_rates(at_.user, mode, t, x.data(), dxdt.data(), x.size(), rates.data(),
                             rates.size()),
             "guard_rates", t);
    }
    template <class X>
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const X& x,
                                    const X& dxdt) const
    {
        double rate = nan;
        heed(at_.guard_rate(at_.user, which, mode, t, x.data(), dxdt.data(), x.size(), &rate),
             "guard_rate", t, which);
        return rate;
    }

    template <class X>
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, X& x) const
    {
        const int code = at_.reset(at_.user, which, &mode, t, x.data(), x.size());
        if (code == stop_code) [[unlikely]]
            end_run_if_asked(code, mode);
        heed(code, "reset", t, which);
        return mode;
    }
    template <class X>
    [[nodiscard]] Mode reset_set(const FiredGuards& fired, Mode mode, double t, X& x) const
    {
        const int code = at_.reset_set(at_.user, fired.guards().data(), fired.size(),
                                       fired.time_event(), &mode, t, x.data(), x.size());
        if (code == stop_code) [[unlikely]]
            end_run_if_asked(code, mode);
        heed(code, "reset_set", t);
        return mode;
    }
    template <class X>
    [[nodiscard]] Mode rest(std::size_t which, Mode mode, double t, X& x) const
    {
        heed(at_.rest(at_.user, which, &mode, t, x.data(), x.size()), "rest", t, which);
        return mode;
    }

    [[nodiscard]] bool enabled_in(std::size_t which, Mode mode) const
    {
        int enabled = 0;
        heed(at_.enabled_in(at_.user, which, mode, &enabled), "enabled_in", nan, which);
        return enabled != 0;
    }
    template <class X>
    [[nodiscard]] bool enabled_at(std::size_t which, Mode mode, double t, const X& x) const
    {
        int enabled = 0;
        heed(at_.enabled(at_.user, which, mode, t, x.data(), x.size(), &enabled), "enabled", t,
             which);
        return enabled != 0;
    }

    [[nodiscard]] double next_time_event(double t) const
    {
        double next = nan;
        heed(at_.next_time_event(at_.user, t, &next), "next_time_event", t);
        return next;
    }
    template <class X>
    [[nodiscard]] double next_time_event_at(Mode mode, double t, const X& x) const
    {
        double next = nan;
        heed(at_.next_time_event_at(at_.user, mode, t, x.data(), x.size(), &next),
             "next_time_event_at", t);
        return next;
    }
    [[nodiscard]] bool has_time_events() const noexcept
    {
        return at_.next_time_event || at_.next_time_event_at || at_.time_event_count > 0 ||
               at_.time_event_period > 0;
    }
    [[nodiscard]] double previous_time_event(double t) const
    {
        double previous = nan;
        heed(at_.previous_time_event(at_.user, t, &previous), "previous_time_event", t);
        return previous;
    }
    template <class X>
    [[nodiscard]] Mode time_reset(Mode mode, double t, X& x) const
    {
        const int code = at_.time_reset(at_.user, &mode, t, x.data(), x.size());
        if (code == stop_code) [[unlikely]]
            end_run_if_asked(code, mode);
        heed(code, "time_reset", t);
        return mode;
    }

    [[nodiscard]] double lipschitz(std::size_t which) const noexcept { return lipschitz_[which]; }
    template <class X>
    [[nodiscard]] double speed_bound(std::size_t which, Mode mode, double t, const X& x) const
    {
        return bound(at_.speed_bound, "speed_bound", which, mode, t, x);
    }
    template <class X>
    [[nodiscard]] double acceleration_bound(std::size_t which, Mode mode, double t,
                                            const X& x) const
    {
        if (!at_.acceleration_bound) return 0;
        return bound(at_.acceleration_bound, "acceleration_bound", which, mode, t, x);
    }
    template <class X>
    [[nodiscard]] double lower_bound(std::size_t which, Mode mode, double t, const X& x) const
    {
        return bound(at_.lower_bound, "lower_bound", which, mode, t, x);
    }
    template <class X>
    [[nodiscard]] double upper_bound(std::size_t which, Mode mode, double t, const X& x) const
    {
        return bound(at_.upper_bound, "upper_bound", which, mode, t, x);
    }

    /// The set-valued motion, if there is one.
    [[nodiscard]] const InclusionCallbacks* inclusion() const noexcept
    {
        return inclusion_ ? &*inclusion_ : nullptr;
    }
    template <class X>
    [[nodiscard]] Mode start_mode(Mode mode, double t, const X& x) const
    {
        heed(inclusion_->callbacks().start_mode(at_.user, &mode, t, x.data(), x.size()),
             "start_mode", t);
        return mode;
    }
    template <class X>
    [[nodiscard]] Mode change(std::size_t reaction, EventKind kind, Mode mode, double t, X& x) const
    {
        heed(inclusion_->callbacks().change(at_.user, reaction, static_cast<std::int32_t>(kind),
                                            &mode, t, x.data(), x.size()),
             "change", t);
        return mode;
    }

    /// A parameter that gates are trained for.
    [[nodiscard]] std::optional<double> parameter(std::string_view name) const;

    std::string name;
    Times times;  ///< a list or a clock

private:
    static constexpr double nan = std::numeric_limits<double>::quiet_NaN();

    template <class X>
    [[nodiscard]] double bound(rc_bound_fn function, const char* callback, std::size_t which,
                               Mode mode, double t, const X& x) const
    {
        double bound = nan;
        heed(function(at_.user, which, mode, t, x.data(), x.size(), &bound), callback, t, which);
        return bound;
    }

    rc_callbacks at_;
    std::optional<InclusionCallbacks> inclusion_;
    std::vector<std::string> guard_names_;
    std::vector<GuardInfo> infos_;
    std::vector<double> lipschitz_;
};

}  // namespace ricochet::c
