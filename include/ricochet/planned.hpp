// Time during which a bound on its speed keeps a guard away from its surface.
//
// A guard that is a distance d from its surface and changes by at most v per second now,
// where v changes by at most A per second per second, covers
//
//     v tau + A tau^2 / 2 < d        from one value: conservative advancement
//     path(tau) < d0 + d1            from two values, with speeds v0 and v1: a guard that
//                                    goes to the surface has to return from it
//
// Every function treats an invalid bound (a negative or infinite speed, or NaN) as covering
// nothing. Speeds are those of the guard: path per second times its
// Lipschitz constant.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "ricochet/bounds.hpp"
#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/debug_checks.hpp"
#include "ricochet/detail/wrapped_detector.hpp"
#include "ricochet/extremum.hpp"

namespace ricochet {

/// Bounds on a guard at one instant: its distance from its surface on the armed side, the rate at
/// which that can change, and the rate at which the speed can change.
struct GuardBound {
    double distance = 0;
    double speed = 0;         ///< [1/s] bound on the rate of the distance
    double acceleration = 0;  ///< [1/s^2] bound on the rate of the speed

    /// Whether the bounds are valid, so that they cover a time.
    [[nodiscard]] bool sound() const noexcept
    {
        constexpr double largest = std::numeric_limits<double>::max();
        return speed >= 0 && speed <= largest && acceleration >= 0 && acceleration <= largest;
    }
};

/// The longest time [s] over which the guard cannot come nearer than 0: the root of
/// v tau + A tau^2 / 2 = d. 0 if the distance is not positive or a bound is not valid;
/// infinite if nothing can move.
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
/// if the two lines meet inside. A is that of the earlier instant; if it is 0, the
/// speed of that instant holds throughout. NaN if a bound is not valid.
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
        return detail::least_of(from.speed, to.speed) * tau + 0.5 * a * tau * tau;
    }
    const double middle = 0.5 * (from.speed + to.speed) * tau + 0.25 * a * tau * tau;
    return middle - 0.25 * gap * (gap / a);
}

/// Whether the guard cannot have come within `band` of its surface between two instants `tau` [s]
/// apart, with the largest change enlarged by the fraction `margin`.
[[nodiscard]] inline bool stays_clear(const GuardBound& from, const GuardBound& to, double tau,
                                      double margin, double band) noexcept
{
    const double change = largest_change(from, to, tau);
    return from.distance > band && to.distance > band &&
           from.distance + to.distance > (1 + margin) * change + 2 * band;
}

/// An estimate of the longest time after which `stays_clear` will be true, if the speed stays
/// constant and the guard continues with `slope` [1/s], bending towards its surface as
/// strongly as it can: the root of
///
///     2 d + slope tau - A tau^2 / 2 = v tau + A tau^2 / 4
///
/// It is only an estimate: it decides when to check, not what is found. On a ball in a cavern the
/// estimate without the bend was too long more often than not.
[[nodiscard]] inline double time_to_check(const GuardBound& at, double slope) noexcept
{
    if (!(at.distance > 0) || !at.sound()) return 0;
    const double closing = detail::greatest_of(at.speed - (std::isfinite(slope) ? slope : 0), 0.0);
    const double root = std::sqrt(closing * closing + 6 * at.acceleration * at.distance);
    return 4 * at.distance / (closing + root);
}

// Detectors that defer exact checks.
//
// A detector of this kind wraps an exact one. For a guard that has just been evaluated it
// tells for how long no check is needed, for how long none is expected to be needed, and whether
// two checks close the interval between them. The loop keeps the queue of deadlines: it continues
// without a check while every guard is covered, tentatively while an interval is expected to be
// closed, and returns to the first step that could not be closed, which is then divided, and
// examined. The steps are those of a run in which every step is checked.
//
//     Planned      by declared bounds (bounds.hpp); the events are those of the exact
//                  detector, bit for bit, and what is skipped is `proved`
//     EveryK       checks every k-th step and returns where the sign has changed; two crossings
//                  between two checks are missed
//     SlopeSkip    skips a fraction of the time in which the guard would reach its surface at
//                  its last slope; may miss events, too
//
// `Planned` on a system without bounds is compiled to the exact detector.

/// How `Planned` plans.
struct PlannerOptions {
    /// Take steps tentatively, until a check at the end of their interval closes it, and roll back
    /// to the first that could not be closed. Off: advance only as far as the bound covers.
    bool two_ended = true;
    /// Largest number of tentative steps in an interval; the starts of as many steps are kept.
    std::size_t longest_interval = 256;
    /// Fraction by which every bound is enlarged, since bounds hold for the motion and steps have
    /// errors. At least 0.
    double margin = 0.01;
    /// Compare bounds with the values of the guard as they are taken, and with extra values at
    /// every eighth lower bound that is used and in every 64th step without a check; a bound
    /// that is wrong, negative or NaN ends the run as `Outcome::wrong_bound`. Even without this,
    /// a guard that is found beyond its surface where a bound has excluded it ends the run, at the
    /// end of the run at the latest.
    bool check_bounds = detail::is_debug_build();
};

namespace detail {

/// @throws std::invalid_argument naming the option.
void validate(const PlannerOptions& options);
/// @throws std::invalid_argument because EveryK needs at least one step.
[[noreturn]] void throw_no_steps_between_checks();
/// @throws std::invalid_argument because an interval of Enclosed needs at least one step.
[[noreturn]] void throw_no_steps_in_interval();
/// @throws std::invalid_argument if SlopeSkip's fraction is not in (0, 1], or it has no steps.
[[noreturn]] void throw_bad_slope_skip(double fraction, std::size_t longest);

template <class Exact>
class PutsOff : public WrappedDetector<Exact> {
public:
    static constexpr bool defers = true;

    using WrappedDetector<Exact>::WrappedDetector;
};

}  // namespace detail

/// Detector that defers the checks of `Exact` as long as declared bounds exclude a crossing.
///
/// With d = |g| at the last check of a guard, v its speed bound there (path per second times its
/// Lipschitz constant) and A its acceleration bound, both enlarged by the margin, the guard is
/// covered for the time tau with
///
///     v tau + A tau² / 2 = d             from one value
///     path(tau) = d0 + d1                from the values d0, d1 at both ends of an interval
///
/// and the loop takes steps as follows:
///
///     while every guard is covered at the end of the next step: take it
///     else take it tentatively, and keep its start
///     when two values are expected to cover the interval: check its end
///         covered: the interval is closed; its steps stand
///         else:    halve it at the kept starts; the first single step that is not covered is
///                  divided on its polynomial, and what stays open is left to `Exact`
///
/// The cover by two values holds because a guard that reaches its surface has to return from it.
/// As long as the bounds are true, the events are those of `Exact` at every step, bit for bit, and
/// those that it loses inside steps; a wrong bound that is found ends the run as `wrong_bound`.
template <class Exact = Extremum>
class Planned : public detail::PutsOff<Exact> {
public:
    static constexpr bool needs_bounds = true;
    static constexpr Evidence deferred = Evidence::proved;  ///< evidence for a step without a check

    Planned() : Planned(PlannerOptions{}) {}
    /// @throws std::invalid_argument if the margin is negative or `longest_interval` is 0.
    explicit Planned(const PlannerOptions& options, const Exact& exact = {})
        : detail::PutsOff<Exact>(exact), options_(options)
    {
        detail::validate(options);
    }

    [[nodiscard]] std::size_t longest() const noexcept
    {
        return options_.two_ended ? options_.longest_interval : 1;
    }
    [[nodiscard]] bool checks_bounds() const noexcept { return options_.check_bounds; }
    [[nodiscard]] double margin() const noexcept { return options_.margin; }

    /// Time [s] for which the guard is covered from here.
    [[nodiscard]] double sure(GuardBound at, double band) const noexcept
    {
        at.distance = (at.distance - band) / (1 + options_.margin);
        return time_covered(at);
    }

    /// Time [s] after which a second check is expected to close the interval.
    [[nodiscard]] double hoped(GuardBound at, double slope, double band) const noexcept
    {
        at.distance -= band;
        return options_.two_ended ? time_to_check(at, slope) : 0;
    }

    [[nodiscard]] bool closes(const GuardBound& from, const GuardBound& to, double tau,
                              double band) const noexcept
    {
        return stays_clear(from, to, tau, options_.margin, band);
    }

private:
    PlannerOptions options_;
};

/// Simplest baseline for comparison: every k-th step is examined.
template <class Exact = Extremum>
class EveryK : public detail::PutsOff<Exact> {
public:
    static constexpr bool needs_bounds = false;
    static constexpr Evidence deferred = Evidence::assumed;

    /// @throws std::invalid_argument if `steps` is 0.
    explicit EveryK(std::size_t steps, const Exact& exact = {})
        : detail::PutsOff<Exact>(exact), steps_(steps)
    {
        if (steps == 0) detail::throw_no_steps_between_checks();
    }

    [[nodiscard]] std::size_t longest() const noexcept { return steps_; }
    [[nodiscard]] static constexpr bool checks_bounds() noexcept { return false; }
    [[nodiscard]] static constexpr double margin() noexcept { return 0; }
    [[nodiscard]] static double sure(const GuardBound&, double) noexcept { return 0; }
    /// Covers a single step at the surface, where an event has left the guard.
    [[nodiscard]] static double hoped(const GuardBound& at, double, double band) noexcept
    {
        return at.distance > band ? std::numeric_limits<double>::infinity() : 0;
    }
    [[nodiscard]] static bool closes(const GuardBound& from, const GuardBound& to, double,
                                     double band) noexcept
    {
        return from.distance > 0 && to.distance > band;
    }

private:
    std::size_t steps_;
};

/// Baseline for guards without a known bound: skips `fraction` |g| / |slope|, with the slope of the
/// last two checks, and at most `longest` steps.
template <class Exact = Extremum>
class SlopeSkip : public detail::PutsOff<Exact> {
public:
    static constexpr bool needs_bounds = false;
    static constexpr Evidence deferred = Evidence::assumed;

    /// @throws std::invalid_argument unless `fraction` is in (0, 1] and `longest` above 0.
    explicit SlopeSkip(double fraction = 0.1, std::size_t longest = 20, const Exact& exact = {})
        : detail::PutsOff<Exact>(exact), fraction_(fraction), longest_(longest)
    {
        if (!(fraction > 0 && fraction <= 1) || longest == 0) {
            detail::throw_bad_slope_skip(fraction, longest);
        }
    }

    [[nodiscard]] std::size_t longest() const noexcept { return longest_; }
    [[nodiscard]] static constexpr bool checks_bounds() noexcept { return false; }
    [[nodiscard]] static constexpr double margin() noexcept { return 0; }
    [[nodiscard]] static double sure(const GuardBound&, double) noexcept { return 0; }
    [[nodiscard]] double hoped(const GuardBound& at, double slope, double) const noexcept
    {
        if (!std::isfinite(slope)) return 0;
        return detail::greatest_of(fraction_ * at.distance / std::fabs(slope), 0.0);
    }
    [[nodiscard]] static bool closes(const GuardBound& from, const GuardBound& to, double,
                                     double band) noexcept
    {
        return from.distance > 0 && to.distance > band;
    }

private:
    double fraction_;
    std::size_t longest_;
};

/// Whether a run of `System` on states X with this detector defers checks.
template <class Detector, class System, class X>
[[nodiscard]] constexpr bool defers_checks() noexcept
{
    if constexpr (Guarded<System, X> && requires { Detector::template suits<System, X>(); }) {
        return Detector::template suits<System, X>();
    } else if constexpr (Guarded<System, X> && requires { Detector::defers; }) {
        return !Detector::needs_bounds || BoundedGuards<System, X>;
    } else {
        return false;
    }
}

}  // namespace ricochet
