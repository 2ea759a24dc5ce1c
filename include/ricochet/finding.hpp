// What a detector is, and its result for a step.
#pragma once

#include <concepts>

#include "ricochet/detail/guard_view.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/run.hpp"

namespace ricochet::detail {

/// A detector that requests one evaluation of every guard inside each step, so that a guard
/// that the step does not resolve is discovered.
template <class Detector>
concept ChecksInside = requires
{
    requires Detector::checks_inside;
};

/// How steps are screened for guards that need a check, as a detector declares it; by default
/// with the detector's own function.
enum class Screening : std::uint8_t {
    ends,      ///< as `Ends`
    extremum,  ///< as `Extremum`
    every,     ///< every step of an armed guard
    own,
};

template <class Detector>
inline constexpr Screening screening_of = [] {
    if constexpr (requires { Detector::screening; }) return Detector::screening;
    return Screening::own;
}();

/// The guard over a step or the rest of one: the side on which it is armed, and its
/// samples at both ends. A detector fills in `side_after`.
struct Watch {
    Side side = Side::plateau;
    GuardSample start;
    GuardSample end;
    double touch = 0;      ///< an extremum with |g| up to this, at least, counts as a touch
    double scale = 0;      ///< the largest |g| that the ends of the step suggest
    bool departs = false;  ///< the start is an event of the guard, or has just enabled it
    Side side_after = Side::plateau;  ///< at the end, if the interval is clear
};

/// Either "clear", with its evidence; or an interval in which the guard leaves `side`: it is
/// still on it at `lo`, and across or on the surface at `hi`; or a touch at `hi`.
struct Finding {
    bool hit = false;
    bool touch = false;
    Evidence evidence = Evidence::assumed;
    Side side = Side::plateau;
    GuardSample lo;
    GuardSample hi;
    bool late = false;  ///< the guard had left its side before the step began

    [[nodiscard]] static constexpr Finding clear(Evidence evidence) noexcept
    {
        Finding finding;
        finding.evidence = evidence;
        return finding;
    }

    [[nodiscard]] static constexpr Finding leaving(Side side, const GuardSample& lo,
                                                   const GuardSample& hi) noexcept
    {
        Finding finding;
        finding.hit = true;
        finding.side = side;
        finding.lo = lo;
        finding.hi = hi;
        return finding;
    }

    [[nodiscard]] static constexpr Finding touching(Side side, const GuardSample& at) noexcept
    {
        Finding finding;
        finding.touch = true;
        finding.side = side;
        finding.lo = at;
        finding.hi = at;
        return finding;
    }
};

}  // namespace ricochet::detail

namespace ricochet {

class GuardPath;

/// Decides whether a guard has an event in a step, and in which part of it.
///
///     uses_rates          whether it reads the rates of guards at the ends of a step
///     evidence            of "no event" in a step that it does not suspect
///     suspects(sign, start, end)               whether a step has to be examined, by the samples
///                         of the guard at its ends; times `sign` it is positive where it is armed
///     leaves_plainly(sign, start, end, touch)  whether an interval holds one crossing and nothing
///                         else, as far as its ends tell; then it is not examined
///     examine(path, watch)                     the first event of the interval, or "clear" with
///                         its evidence; sets `side_after`
///
/// A detector is a value without state that changes: several threads may use it. `screening`,
/// `checks_inside` and `check(system, x, smallest, largest)` are optional.
/// `tests/conformance/detectors.hpp` tests what is promised here.
template <class D>
concept Detector = std::copy_constructible<D> &&
    requires(const D& detector, double sign, const GuardSample& sample, GuardPath& path,
             detail::Watch& watch)
{
    {
        D::uses_rates
        } -> std::convertible_to<bool>;
    {
        D::evidence
        } -> std::convertible_to<Evidence>;
    {
        D::suspects(sign, sample, sample)
        } -> std::convertible_to<bool>;
    {
        D::leaves_plainly(sign, sample, sample, sign)
        } -> std::convertible_to<bool>;
    {
        detector.examine(path, watch)
        } -> std::same_as<detail::Finding>;
};

}  // namespace ricochet
