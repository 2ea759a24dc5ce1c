// Internal: the declarations of this header may change without notice.
//
// View of one guard of a system for detectors and locators: evaluations are counted,
// and the rate is available whether or not the system has one in closed form.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// The index in the type that x uses for its indices.
template <class Index, class X>
[[nodiscard]] constexpr auto own(Index i, const X& x) noexcept
{
    return static_cast<decltype(x.size())>(i);
}

/// x + factor * direction, one component at a time.
template <class X, class D>
class MovedView {
public:
    MovedView(const X& x, double factor, const D& direction) noexcept
        : x_(&x), direction_(&direction), factor_(factor)
    {
    }
    template <class Index>
    [[nodiscard]] double operator[](Index i) const noexcept
    {
        return (*x_)[own(i, *x_)] + factor_ * (*direction_)[own(i, *direction_)];
    }
    [[nodiscard]] auto size() const noexcept { return x_->size(); }

private:
    const X* x_;
    const D* direction_;
    double factor_;
};

/// -x, one component at a time.
template <class X>
class NegatedView {
public:
    explicit NegatedView(const X& x) noexcept : x_(&x) {}
    template <class Index>
    [[nodiscard]] double operator[](Index i) const noexcept
    {
        return -(*x_)[own(i, *x_)];
    }
    [[nodiscard]] auto size() const noexcept { return x_->size(); }

private:
    const X* x_;
};

/// The difference quotient of a guard on the side where it is finite, from g here and `ahead` and
/// `behind` at `delta` [s] to either side; NaN if it is finite on neither.
[[nodiscard, gnu::cold, gnu::noinline]] inline double one_sided(double g, double ahead,
                                                                double behind,
                                                                double delta) noexcept
{
    const double forward = (ahead - g) / delta;
    const double backward = (g - behind) / delta;
    if (std::isfinite(forward)) return forward;
    return std::isfinite(backward) ? backward : std::numeric_limits<double>::quiet_NaN();
}

template <class X>
[[nodiscard]] X negated(X x)
{
    for_each_component(
        x, [&](auto i) __attribute__((always_inline)) { x[i] = -x[i]; });
    return x;
}

/// One guard in one mode. Rates are with respect to the offset inside a step, so in
/// a run backward in time they are the negative of dg/dt.
template <class System, class X>
class GuardView {
public:
    using State = X;

    /// Guard of a system that has one. Keeps references to both; `calls` is
    /// incremented at every evaluation.
    GuardView(const System& system, std::uint64_t& calls) noexcept
        : GuardView(system, calls, {}, guard_info_of<X>(system, 0).crossing)
    {
    }

    GuardView(const System& system, std::uint64_t& calls, const GuardInMode& at,
              Crossing crossing = Crossing::falling) noexcept
        : system_(&system), calls_(&calls), at_(at), crossing_(crossing)
    {
    }

    /// Whether the guard can be evaluated on a view of the state.
    template <class V>
    static constexpr bool sees = GuardAlone<System, V>;

    /// Whether its rate can be evaluated on views of the state and of its rate.
    template <class V, class D>
    static constexpr bool sees_rate =
        RateAlone<System, V, D>&& RateAlone<System, V, NegatedView<D>>;

    /// Whether the system gives its rate; else it is a difference quotient.
    static constexpr bool is_rated = RatedGuard<System, X>;

    [[nodiscard]] const System& system() const noexcept { return *system_; }
    [[nodiscard]] std::size_t which() const noexcept { return at_.which; }
    [[nodiscard]] Mode mode() const noexcept { return at_.mode; }
    [[nodiscard]] Crossing crossing() const noexcept { return crossing_; }

    /// Degree of the guard as a polynomial in time and state; 0: not declared.
    [[nodiscard]] int degree() const { return guard_info_of<X>(*system_, at_.which).degree; }

    /// Counts an evaluation that other code makes.
    void count() const noexcept { ++*calls_; }

    /// g(t, x); x is a state, or a view of one where the guard `sees` it.
    template <class V>
    [[nodiscard]] double value(double t, const V& x) const
    {
        count();
        if constexpr (sees<V>) {
            return call_guard(*system_, at_.which, at_.mode, t, x);
        } else {
            return one_of_all(t, x);
        }
    }

    /// The rate at (t, x) with x' = dxdt: `guard_rate` of the system, else by dual numbers through
    /// its guard where that takes any scalar, else from `guard_rates`, else `difference`, which
    /// also replaces a rate that is not finite.
    template <class V, class D>
    [[nodiscard]] double rate(double t, const V& x, const D& dxdt, double scale) const
    {
        const double rate = raw_rate(t, x, dxdt, scale);
        if constexpr (RateAlone<System, V, D> || rated_together<V, D>) {
            constexpr double largest = std::numeric_limits<double>::max();
            if (!(std::fabs(rate) <= largest)) return replaced_rate(t, x, dxdt, scale);
        }
        return rate;
    }

    /// Same as `rate`, but a closed form that is not finite is not replaced.
    template <class V, class D>
    [[nodiscard, gnu::always_inline]] double raw_rate(double t, const V& x, const D& dxdt,
                                                      double scale) const
    {
        if constexpr (RateAlone<System, V, D>) {
            return known_rate(t, x, dxdt);
        } else if constexpr (rated_together<V, D>) {
            return rate_of_all(t, x, dxdt);
        } else {
            return difference(t, x, dxdt, scale);
        }
    }

private:
    /// Whether the system gives its rates, at a state, only all together.
    template <class V, class D>
    static constexpr bool rated_together =
        std::is_same_v<V, D> && !RateAlone<System, V, D> && RatesTogether<System, V>;

    /// The rate in closed form.
    template <class V, class D>
    [[nodiscard, gnu::always_inline]] double known_rate(double t, const V& x, const D& dxdt) const
    {
        if constexpr (RateByDuals<System, V> && !RateWritten<System, V, D>) {
            return rate_by_duals(*system_, at_.which,
                                 Along{at_.mode, t, x, dxdt, at_.backward ? -1.0 : 1.0});
        } else {
            if (!at_.backward) return call_rate(t, x, dxdt);
            if constexpr (sees_rate<V, D>) {
                const NegatedView<D> forward(dxdt);
                return -call_rate(t, x, forward);
            } else {
                return -call_rate(t, x, negated(dxdt));
            }
        }
    }

    template <class V, class D>
    [[nodiscard, gnu::always_inline]] double call_rate(double t, const V& x, const D& dxdt) const
    {
        return detail::call_rate(*system_, at_.which, Along{at_.mode, t, x, dxdt});
    }

    /// The rate where the closed form has none. Its evaluations are not counted.
    template <class V, class D>
    [[nodiscard, gnu::cold, gnu::noinline]] double replaced_rate(double t, const V& x,
                                                                 const D& dxdt, double scale) const
    {
        std::uint64_t calls = 0;
        return GuardView(*system_, calls, at_, crossing_).difference(t, x, dxdt, scale);
    }

    /// The central difference along the flow over 1e-5 of the time `scale` [s] to either side: its
    /// truncation error is 1e-10 scale^2 / 6 times the third derivative, and it magnifies rounding
    /// in g by 1e5 / scale. Where the guard exists on one side only, it is the difference to that
    /// side.
    template <class V, class D>
    [[nodiscard]] double difference(double t, const V& x, const D& dxdt, double scale) const
    {
        const double delta = 1e-5 * scale;
        const double ahead = moved(t, x, dxdt, delta);
        const double behind = moved(t, x, dxdt, -delta);
        const double central = (ahead - behind) / (2 * delta);
        return std::isfinite(central) ? central : one_sided(value(t, x), ahead, behind, delta);
    }

    /// The guard after a time `s` along a straight line.
    template <class V, class D>
    [[nodiscard]] double moved(double t, const V& x, const D& dxdt, double s) const
    {
        const double later = at_.backward ? t - s : t + s;
        using Moved = MovedView<V, D>;
        if constexpr (sees<Moved>) {
            return value(later, Moved(x, s, dxdt));
        } else {
            V there = x;
            move(there, x, s, dxdt);
            return value(later, there);
        }
    }

    /// One guard of a system that evaluates its guards only all together.
    template <class V>
    [[nodiscard]] double one_of_all(double t, const V& x) const
    {
        return one_of([&](std::span<double> all) { call_guards(*system_, at_.mode, t, x, all); });
    }

    /// One rate of a system that computes its rates only all together.
    [[nodiscard]] double rate_of_all(double t, const X& x, const X& dxdt) const
    {
        const auto along = [&](const X& forward) {
            return one_of([&](std::span<double> all) {
                call_rates(*system_, Along<X>{at_.mode, t, x, forward}, all);
            });
        };
        return at_.backward ? -along(negated(dxdt)) : along(dxdt);
    }

    /// This guard's number among those that `compute` writes for all guards.
    template <class Compute>
    [[nodiscard]] double one_of(const Compute& compute) const
    {
        constexpr std::size_t fixed = fixed_guard_count<System, X>();
        constexpr std::size_t on_stack = fixed == counted_at_run_time ? 256 : fixed;
        const std::size_t count = guard_count_of<X>(*system_);
        std::array<double, on_stack> few;
        std::vector<double> many(count > on_stack ? count : 0);
        const std::span<double> all(count > on_stack ? many.data() : few.data(), count);
        compute(all);
        return all[at_.which];
    }

    const System* system_;
    std::uint64_t* calls_;
    GuardInMode at_;
    Crossing crossing_;
};

}  // namespace ricochet::detail
