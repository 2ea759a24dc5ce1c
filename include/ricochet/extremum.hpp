// Detectors that sample a guard: at the ends of a step, and at its extremum inside.
#pragma once

#include <cmath>
#include <string_view>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/step_probe.hpp"

namespace ricochet {

// The simplest approach compares the sides of a guard at both ends of a step.
//
// One guard call a step. Two crossings within one step cancel and are not seen,
// so "no event" is only assumed.

/// Detector that compares the signs of a guard at both ends of a step, at one guard call a step.
/// Two crossings within one step cancel and are not found.
struct Ends {
    static constexpr std::string_view name = "ends";
    static constexpr bool uses_rates = false;
    static constexpr detail::Screening screening = detail::Screening::ends;
    static constexpr Evidence evidence = Evidence::assumed;  ///< evidence for a step not suspected

    /// Whether a step needs a check, from the guard times `sign`, which is positive on its
    /// armed side.
    [[nodiscard]] static constexpr bool suspects(double sign, const GuardSample& /*start*/,
                                                 const GuardSample& end) noexcept
    {
        return !(sign * end.value > 0);
    }

    /// Whether the interval holds one crossing and nothing else, as far as its ends tell.
    [[nodiscard]] static bool leaves_plainly(double sign, const GuardSample& /*start*/,
                                             const GuardSample& end, double /*touch*/) noexcept
    {
        return sign * end.value < 0;
    }

    /// Where the guard is zero at the end, bit for bit, its values around there tell whether it
    /// crosses or turns back.
    [[nodiscard]] detail::Finding examine(GuardPath& path, detail::Watch& watch) const
    {
        if (watch.end.value == 0 && watch.side != Side::plateau && turns_back(path, watch)) {
            watch.side_after = watch.side;
            return detail::Finding::clear(Evidence::assumed);
        }
        return compare_signs(path, watch);
    }

    /// Finding from the sides alone; zero belongs to either.
    [[nodiscard]] static detail::Finding compare_signs(const GuardPath& path, detail::Watch& watch)
    {
        const bool left = detail::has_left(watch.side, watch.end.value);
        watch.side_after = left ? detail::opposite(watch.side) : watch.side;
        if (left && detail::counts(watch.side, path.crossing())) {
            return detail::Finding::leaving(watch.side, watch.start, watch.end);
        }
        return detail::Finding::clear(Evidence::assumed);
    }

private:
    [[nodiscard]] static bool turns_back(GuardPath& path, const detail::Watch& watch);
};

// The classical approach: the guard and its rate at both ends of the step.
//
// The four numbers define a cubic. If the guard heads for its surface at the start
// and away from it at the end, or the cubic's control points reach across, there may
// be an extremum on the other side: it is located on the step itself, by Newton's method
// on the rate, and only as precisely as needed to decide on which side it lies. Smooth
// guards are caught unless they turn more often within a step than a cubic can.

/// Detector that evaluates a guard at both ends of a step and once inside, compares it with the
/// cubic through values and rates, and searches for extrema if that leaves doubts: the default.
struct Extremum {
    static constexpr std::string_view name = "extremum";
    static constexpr bool uses_rates = true;
    static constexpr detail::Screening screening = detail::Screening::extremum;
    static constexpr bool checks_inside = true;  ///< compares each step with the cubic of its ends
    static constexpr Evidence evidence = Evidence::checked;  ///< evidence for a step not suspected

    /// Whether a step needs a check, from the guard times `sign`, positive on its armed side: the
    /// guard has left that side, or the control points of its cubic reach across the surface, or it
    /// turns back from the surface. A guard that turns back needs no check if its control points
    /// differ by less than a fifth of their largest: to reach the surface it would have to bend
    /// five times as much as its values and rates at the ends show.
    ///
    /// The expression has no branches and shares its terms with `CubicCheck`, so that a loop over
    /// many guards is vectorised.
    [[nodiscard, gnu::always_inline]] static constexpr bool suspects(
        double sign, const GuardSample& start, const GuardSample& end) noexcept
    {
        const double third = (end.s - start.s) / 3;
        const double slope0 = start.rate * third;
        const double slope1 = end.rate * third;
        const double b1 = sign * (start.value + slope0);
        const double b2 = sign * (end.value - slope1);
        const double v1 = sign * end.value;
        const double lowest = detail::least_of(detail::least_of(b1, b2), v1);
        const double highest = detail::greatest_of(detail::greatest_of(b1, b2), v1);
        const bool turns = (sign * slope0 <= 0) & (sign * slope1 > 0);
        const bool clear = (v1 > 0) & (lowest > 0) & (!turns | (1.25 * lowest > highest));
        return !clear;
    }

    /// Whether the interval holds one crossing and nothing else, as far as its ends tell:
    /// the cubic is beyond the surface at the end, and its control points do not come
    /// back.
    [[nodiscard]] static bool leaves_plainly(double sign, const GuardSample& start,
                                             const GuardSample& end, double touch) noexcept
    {
        const double third = (end.s - start.s) / 3;
        const double b1 = sign * (start.value + start.rate * third);
        const double b2 = sign * (end.value - end.rate * third);
        return sign * end.value < -touch && !(b1 < 0 && b2 > 0) && std::isfinite(b1 + b2);
    }

    [[nodiscard]] detail::Finding examine(GuardPath& path, detail::Watch& watch) const;
};

}  // namespace ricochet
