// An exact alternative to a network: where the guard is a parabola in time, whether a
// step meets the event surface is one inequality.
#pragma once

#include "ricochet/detail/features.hpp"
#include "ricochet/gates.hpp"

namespace ricochet {

/// Predicts as `BareNetwork` does, with the same remedies for its mistakes, from
///
///     g + g' h + g'' h^2 / 2 <= 0   iff the guard is on or below its surface after h,
///
/// which for a ball in free fall is u / (g h^2) + v / (g h) <= 1/2. Exact up to
/// rounding for a falling guard of constant negative curvature.
struct BallisticLine {
    static constexpr bool uses_rates = false;
    static constexpr detail::Screening screening = detail::Screening::ends;
    static constexpr Evidence evidence = Evidence::assumed;  ///< of a step not suspected
    static constexpr bool checks_every_step = false;

    /// Nothing has been trained, so nothing can be unsuitable.
    template <class System, class X>
    requires CurvedGuard<System, X>
    void check(const System& /*system*/, const X& /*x*/, double /*smallest*/,
               double /*largest*/) const noexcept
    {
    }

    template <class Guard, class Step>
    [[nodiscard]] bool clears(const Guard& guard, const Step& step) const noexcept
    {
        const double t = step.time(0);
        const double h = step.h();
        const double value = guard.value(t, step.x0());
        const double rate = guard.rate(t, step.x0(), step.rate0(), h);
        const double curvature = detail::curvature_of(guard.system(), t, step.x0());
        return value + h * (rate + 0.5 * h * curvature) > 0;
    }

    [[nodiscard]] static constexpr bool suspects(double sign, const GuardSample& start,
                                                 const GuardSample& end) noexcept
    {
        return Ends::suspects(sign, start, end);
    }

    /// A prediction may be late, so every event is examined with care.
    [[nodiscard]] static bool leaves_plainly(double, const GuardSample&, const GuardSample&,
                                             double) noexcept
    {
        return false;
    }

    [[nodiscard]] detail::Finding examine(GuardPath& probe, detail::Watch& watch) const
    {
        return detail::examine_prediction(probe, watch);
    }
};

}  // namespace ricochet
