// The result of a detector for a step.
#pragma once

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
