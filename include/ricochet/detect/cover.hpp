// Time over which a bound on its speed keeps a guard away from its surface.
//
// A guard that is a distance d from its surface and changes by at most v per second now,
// where v changes by at most A per second per second, covers
//
//     v tau + A tau^2 / 2 < d        from one value: conservative advancement
//     path(tau) < d0 + d1            from two values, with speeds v0 and v1: the one that
//                                    goes to the surface has to come back from it
//
// Every function answers a doubt (a negative or infinite speed, anything that is not a
// number) with "covers nothing". Speeds are of the guard: path per second times its
// Lipschitz constant.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace ricochet {

/// A guard at one instant: how far it is from its surface on its armed side, how fast
/// that can change, and how fast the speed can change.
struct GuardBound {
    double distance = 0;
    double speed = 0;         ///< [1/s] of the distance
    double acceleration = 0;  ///< [1/s^2]

    /// Whether the bounds are such that anything follows from them.
    [[nodiscard]] bool sound() const noexcept
    {
        constexpr double largest = std::numeric_limits<double>::max();
        return speed >= 0 && speed <= largest && acceleration >= 0 && acceleration <= largest;
    }
};

/// The longest time [s] over which the guard cannot come nearer than 0: the root of
/// v tau + A tau^2 / 2 = d. 0 where the distance is not positive or a bound not sound;
/// infinite where nothing can move.
[[nodiscard]] inline double time_covered(const GuardBound& at) noexcept
{
    if (!(at.distance > 0) || !at.sound()) return 0;
    const double root = std::sqrt(at.speed * at.speed + 2 * at.acceleration * at.distance);
    return 2 * at.distance / (at.speed + root);
}

/// The largest change of the guard over `tau` >= 0 [s] between two instants: the integral
/// of min(v0 + A s, v1 + A (tau - s)), which is
///
///     (v0 + v1) tau / 2 + A tau^2 / 4 - (v1 - v0)^2 / (4 A)
///
/// where the two lines meet inside. A is that of the earlier instant, and where it is 0
/// its speed holds throughout. NaN where a bound is not sound.
[[nodiscard]] inline double largest_change(const GuardBound& from, const GuardBound& to,
                                           double tau) noexcept
{
    if (!from.sound() || !to.sound() || !(tau >= 0)) {
        return std::numeric_limits<double>::quiet_NaN();
    }
    const double a = from.acceleration;
    if (a == 0) return from.speed * tau;
    const double gap = to.speed - from.speed;
    if (std::fabs(gap) >= a * tau) {
        return std::min(from.speed, to.speed) * tau + 0.5 * a * tau * tau;
    }
    const double middle = 0.5 * (from.speed + to.speed) * tau + 0.25 * a * tau * tau;
    return middle - 0.25 * gap * (gap / a);
}

/// Whether the guard cannot have reached its surface between two instants `tau` [s] apart,
/// nor a band of `band` around it, with the change taken larger by the fraction `margin`.
[[nodiscard]] inline bool stays_clear(const GuardBound& from, const GuardBound& to, double tau,
                                      double margin, double band) noexcept
{
    const double change = largest_change(from, to, tau);
    return from.distance > band && to.distance > band &&
           from.distance + to.distance > (1 + margin) * change + 2 * band;
}

/// A guess at the longest time after which `stays_clear` will say yes, if the speed stays
/// what it is and the guard continues with `slope` [1/s], which bends towards the surface as
/// fast as it can: the root of
///
///     2 d + slope tau - A tau^2 / 2 = v tau + A tau^2 / 4
///
/// Only a guess: it decides when to look, not what is seen. On a ball in a cavern the guess
/// without the bend was too long more often than not.
[[nodiscard]] inline double time_to_look(const GuardBound& at, double slope) noexcept
{
    if (!(at.distance > 0) || !at.sound()) return 0;
    const double closing = std::max(at.speed - (std::isfinite(slope) ? slope : 0), 0.0);
    const double root = std::sqrt(closing * closing + 6 * at.acceleration * at.distance);
    return 4 * at.distance / (closing + root);
}

}  // namespace ricochet
