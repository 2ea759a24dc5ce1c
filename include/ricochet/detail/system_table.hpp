// Internal: the declarations of this header may change without notice.
//
// A system as a table of pointers to functions, whatever form they have, for the loop.
//
// Functions that a system does not have are null. Each takes the adapter first, which holds the
// system (detail/system_adapter.hpp). Rates are with respect to the offset in a step: in a run
// backward in time they have the opposite sign.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// A guard and its rate; two numbers, which are returned in registers.
struct GuardPoint {
    double value;
    double rate;
};

/// A time inside a step and the length over which the motion is taken as smooth; two numbers, which
/// are passed in registers.
struct ScaledTime {
    double t;      ///< [s]
    double scale;  ///< [s]
};

template <class X>
struct PhaseTable;

template <class X>
struct SystemTable {
    using SystemAdapter = void*;
    using View = PolynomialView<X, false>;
    using RateView = PolynomialView<X, true>;

    std::size_t size = sizeof(SystemTable);

    bool guarded = false;
    bool moded = false;
    bool rated = false;        ///< every guard's rate is known in closed form
    bool guard_alone = false;  ///< one guard can be evaluated without the others
    bool fixed_dimension = false;
    bool changes_dimension = false;  ///< in resets, whatever the mode
    bool forward_only = false;
    bool bounded = false;

    /// False: the flow has given its rate another dimension, and the rate is now NaN.
    bool (*flow)(SystemAdapter, Mode, double t, const X& x, X& dxdt) = nullptr;
    std::size_t (*mode_count)(SystemAdapter) = nullptr;   ///< 0: not declared
    std::size_t (*guard_count)(SystemAdapter) = nullptr;  ///< 0 where it has none
    std::string (*name)(SystemAdapter) = nullptr;
    GuardInfo (*info)(SystemAdapter, std::size_t which) = nullptr;

    /// All guards.
    void (*guards)(SystemAdapter, Mode, double t, const X& x, std::span<double> g) = nullptr;
    /// One guard, at a state or a view of the step's polynomial.
    double (*guard)(SystemAdapter, std::size_t which, Mode, double t, const X& x) = nullptr;
    double (*guard_on)(SystemAdapter, std::size_t which, Mode, double t, const View& x) = nullptr;
    /// Rate of a guard with x' = dxdt: in closed form, else the central difference over 1e-5
    /// `scale` (near an end of the run `CoreGuard` takes another one), at the cost of
    /// `calls_of_rate` evaluations of the guard.
    double (*rate)(SystemAdapter, GuardInMode, ScaledTime, const X& x, const X& dxdt) = nullptr;
    double (*rate_on)(SystemAdapter, GuardInMode, ScaledTime, const View& x,
                      const RateView& dxdt) = nullptr;
    unsigned calls_of_rate = 0;
    /// Value and rate in one call. Null where a system computes guards or rates all together.
    GuardPoint (*point)(SystemAdapter, GuardInMode, ScaledTime, const X& x,
                        const X& dxdt) = nullptr;
    /// All rates, from one call of the system, with respect to the time itself.
    void (*rates)(SystemAdapter, const Along<X>&, std::span<double> rates) = nullptr;
    /// All rates, with a call for each guard, with respect to the time itself.
    void (*each_rate)(SystemAdapter, const Along<X>&, std::span<double> rates) = nullptr;

    bool (*enabled_in)(SystemAdapter, std::size_t which, Mode) = nullptr;
    bool (*enabled_at)(SystemAdapter, std::size_t which, Mode, double t, const X& x) = nullptr;
    Mode (*reset)(SystemAdapter, std::size_t which, Mode, double t, X& x) = nullptr;
    /// Called before `reset`: the direction in which the guard has crossed. Null where resets do
    /// not ask for it.
    void (*tell_direction)(SystemAdapter, Crossing) = nullptr;
    Mode (*reset_set)(SystemAdapter, const FiredGuards&, Mode, double t, X& x) = nullptr;
    /// Called after all resets of a set, with the mode before them; gives the mode after the set.
    Mode (*after_set)(SystemAdapter, const FiredGuards&, Mode, double t, const X& before,
                      X& x) = nullptr;
    Mode (*rest)(SystemAdapter, std::size_t which, Mode, double t, X& x) = nullptr;
    /// Whether `rest` has an answer for a guard whose events accumulate together with those of
    /// another one, or of `no_guard`. Null: always.
    bool (*rests)(SystemAdapter, std::size_t which, std::size_t other) = nullptr;

    double (*next_time_event)(SystemAdapter, double t) = nullptr;
    double (*previous_time_event)(SystemAdapter, double t) = nullptr;
    /// Asked at the start and after every set instead of `next_time_event`; may answer t.
    double (*next_time_event_at)(SystemAdapter, Mode, double t, const X& x) = nullptr;
    /// How often t is listed, for systems with `Times`; null for others.
    std::size_t (*time_event_count)(SystemAdapter, double t) = nullptr;
    Mode (*time_reset)(SystemAdapter, Mode, double t, X& x) = nullptr;

    double (*lipschitz)(SystemAdapter, std::size_t which) = nullptr;
    double (*speed_bound)(SystemAdapter, std::size_t which, Mode, double t, const X& x) = nullptr;
    double (*acceleration_bound)(SystemAdapter, std::size_t which, Mode, double t,
                                 const X& x) = nullptr;
    double (*lower_bound)(SystemAdapter, std::size_t which, Mode, double t, const X& x) = nullptr;
    double (*upper_bound)(SystemAdapter, std::size_t which, Mode, double t, const X& x) = nullptr;

    /// Null: the motion is that of the flow throughout.
    const PhaseTable<X>* phases = nullptr;

    [[nodiscard]] bool resets() const noexcept { return reset || reset_set; }
    [[nodiscard]] bool timed() const noexcept { return next_time_event || next_time_event_at; }
};

/// The times between which the functions of a system may be called, and work space for a state.
template <class X>
struct RunSpan {
    double from = -std::numeric_limits<double>::infinity();  ///< [s]
    double to = std::numeric_limits<double>::infinity();     ///< [s]
    X moved{};

    [[nodiscard]] bool holds(double t, double reach) const noexcept
    {
        return t - reach >= from && t + reach <= to;
    }
    /// An offset [s] of at most `length` such that twice the offset from t lies inside.
    [[nodiscard]] double inward(double t, double length) const noexcept
    {
        return to - t >= t - from ? least_of(length, (to - t) / 2)
                                  : -least_of(length, (t - from) / 2);
    }
};

/// A table and the adapter that its functions take.
template <class X>
class SystemAt {
public:
    /// @param span  null: functions may be called at any time
    SystemAt(const SystemTable<X>& table, void* adapter, RunSpan<X>* span = nullptr) noexcept
        : table_(&table), adapter_(adapter), span_(span)
    {
    }

    [[nodiscard]] RunSpan<X>* span() const noexcept { return span_; }
    [[nodiscard]] double earliest() const noexcept { return span_ ? span_->from : -infinite; }
    [[nodiscard]] double latest() const noexcept { return span_ ? span_->to : infinite; }
    /// Whether a central difference over `delta` [s] around t would leave the span.
    [[nodiscard]] bool is_near_end(double t, double delta) const noexcept
    {
        return span_ && !span_->holds(t, delta);
    }

    [[nodiscard]] const SystemTable<X>* operator->() const noexcept { return table_; }
    [[nodiscard]] void* adapter() const noexcept { return adapter_; }

    [[nodiscard]] std::size_t modes() const { return table_->mode_count(adapter_); }
    [[nodiscard]] bool enabled_in(std::size_t which, Mode mode) const
    {
        return !table_->enabled_in || table_->enabled_in(adapter_, which, mode);
    }
    [[nodiscard]] bool enabled_at(std::size_t which, Mode mode, double t, const X& x) const
    {
        return !table_->enabled_at || table_->enabled_at(adapter_, which, mode, t, x);
    }

    /// Whether a reset may leave `after` where the state was `before`.
    [[nodiscard]] bool fits_dimension(const X& before, const X& after,
                                      bool same_mode) const noexcept
    {
        if constexpr (fixed_size<X>() > 0) {
            return true;
        } else {
            return table_->fixed_dimension || table_->changes_dimension ||
                   after.size() >= before.size() || !same_mode;
        }
    }

private:
    static constexpr double infinite = std::numeric_limits<double>::infinity();

    const SystemTable<X>* table_;
    void* adapter_;
    RunSpan<X>* span_;
};

/// One guard of a system in one mode, for probes: as `GuardView`, but through the adapter.
template <class X>
class CoreGuard {
    using View = PolynomialView<X, false>;
    using RateView = PolynomialView<X, true>;

public:
    using State = X;

    CoreGuard(const SystemAt<X>& system, std::uint64_t& calls, const GuardInMode& at,
              const GuardInfo& info) noexcept
        : system_(system), at_(at), calls_(&calls), info_(&info)
    {
    }

    template <class V>
    static constexpr bool sees = std::is_same_v<V, View>;
    template <class V, class D>
    static constexpr bool sees_rate = std::is_same_v<V, View>&& std::is_same_v<D, RateView>;
    [[nodiscard]] bool sees_views() const noexcept { return system_->guard_on; }
    [[nodiscard]] bool sees_rate_views() const noexcept { return system_->rate_on; }

    [[nodiscard]] bool is_rated() const noexcept { return system_->rated; }
    [[nodiscard]] std::size_t which() const noexcept { return at_.which; }
    [[nodiscard]] Mode mode() const noexcept { return at_.mode; }
    [[nodiscard]] Crossing crossing() const noexcept { return info_->crossing; }
    [[nodiscard]] int degree() const noexcept { return info_->degree; }
    [[nodiscard]] const SystemAt<X>& system() const noexcept { return system_; }

    [[nodiscard]] double value(double t, const X& x) const
    {
        ++*calls_;
        return system_->guard(system_.adapter(), at_.which, at_.mode, t, x);
    }
    [[nodiscard]] double value(double t, const View& x) const
    {
        ++*calls_;
        return system_->guard_on(system_.adapter(), at_.which, at_.mode, t, x);
    }
    /// @param g  the value there, where it is known
    [[nodiscard]] double rate(double t, const X& x, const X& dxdt, double scale,
                              double g = std::numeric_limits<double>::quiet_NaN()) const
    {
        if (is_cut(t, scale)) return rate_inside(t, x, dxdt, scale, g == g ? g : value(t, x));
        *calls_ += system_->calls_of_rate;
        return system_->rate(system_.adapter(), at_, {t, scale}, x, dxdt);
    }
    [[nodiscard]] double raw_rate(double t, const X& x, const X& dxdt, double scale) const
    {
        return rate(t, x, dxdt, scale);
    }
    [[nodiscard, gnu::always_inline]] GuardPoint point(double t, const X& x, const X& dxdt,
                                                       double scale) const
    {
        if (is_cut(t, scale)) {
            const double g = value(t, x);
            return {g, rate_inside(t, x, dxdt, scale, g)};
        }
        if (!system_->point) return {value(t, x), rate(t, x, dxdt, scale)};
        *calls_ += 1 + system_->calls_of_rate;
        return system_->point(system_.adapter(), at_, {t, scale}, x, dxdt);
    }
    [[nodiscard]] double rate(double t, const View& x, const RateView& dxdt, double scale) const
    {
        return system_->rate_on(system_.adapter(), at_, {t, scale}, x, dxdt);
    }

private:
    /// Whether the rate is a difference that would leave the span of the run.
    [[nodiscard]] bool is_cut(double t, double scale) const noexcept
    {
        return system_->calls_of_rate > 0 && system_.is_near_end(t, 1e-5 * scale);
    }

    /// The rate by a difference of second order to one side, inside the span.
    [[nodiscard, gnu::cold, gnu::noinline]] double rate_inside(double t, const X& x, const X& dxdt,
                                                               double scale, double g) const
    {
        RunSpan<X>& span = *system_.span();
        const double delta = span.inward(t, 1e-5 * scale);
        const auto moved = [&](double later) {
            if (span.moved.size() != x.size()) span.moved = x;
            move(span.moved, x, at_.backward ? -later : later, dxdt);
            return value(t + later, span.moved);
        };
        const double near = moved(delta) - g;
        const double far = moved(2 * delta) - g;
        const double first = near / delta;
        const double second = (4 * near - far) / (2 * delta);
        // Of a guard that is flat there only the first has the sign of its departure.
        const bool flat = first * second < 0 && std::fabs(second) > std::fabs(first);
        const double slope = std::isfinite(second) && !flat ? second : first;
        return at_.backward ? -slope : slope;
    }

    SystemAt<X> system_;
    GuardInMode at_;
    std::uint64_t* calls_;
    const GuardInfo* info_;
};

}  // namespace ricochet::detail
