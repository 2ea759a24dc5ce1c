// Locators: they find where in a bracket a guard leaves its side.
#pragma once

#include <concepts>

#include "ricochet/step_probe.hpp"

namespace ricochet {

/// Finds where a guard leaves its side: `locate(path, lo, hi, tolerance)` narrows the bracket
/// from `lo`, where the guard is on its side, to `hi`, where it is not, until it is no wider than
/// `tolerance` [s] or its ends are neighbouring doubles. It evaluates the guard inside the bracket
/// alone, and returns the ends that it has come to.
template <class L>
concept Locator = std::copy_constructible<L> &&
    requires(const L& locator, GuardPath& path, const GuardSample& sample, double tolerance)
{
    {
        locator.locate(path, sample, sample, tolerance)
        } -> std::same_as<detail::Location>;
};

// Bisection on the step's own map: the simplest locator, and the one of the source paper.

/// Halves the bracket until it is no wider than the tolerance or its ends are
/// neighbouring doubles. Only the side of the guard is used, so any guard will do; its
/// values are used only at the end, to tell a zero from a jump.
struct Bisection {
    [[nodiscard]] detail::Location locate(GuardPath& path, GuardSample lo, GuardSample hi,
                                          double tolerance) const;
};

// Newton's method inside a bracket, with the slope from the flow: the default.
//
// The first guess is the root of the cubic through the guard and its rates at both
// ends of the bracket. Once a sample is so close to the root that the motion from there
// is straight to the last bit, the root is extrapolated along the flow at that
// sample, which costs no further step: the bracket closes around the root at the
// price of guard calls alone, and does not widen with the rounding of a long step.
// A straight guard does not imply that the rest of the state is straight: the extrapolation
// never spans more than a small part of the bracket, the square of which is rounding.

namespace detail {

/// Root in [0, 1] of the cubic with values v0, v1 and slopes r0, r1 at 0 and 1,
/// where it leaves the side of `sign` (1: above, -1: below). Newton's method starts
/// from the root of the parabola through v0, r0 and v1, which for a guard with curvature of
/// one sign is already near; a start on the surface is not taken for the root.
[[nodiscard]] double hermite_root(double v0, double r0, double v1, double r1, double sign) noexcept;

}  // namespace detail

/// Locator by Newton's method inside a bracket, with the slope along the flow: the default.
struct Newton {
    [[nodiscard]] detail::Location locate(GuardPath& path, GuardSample lo, GuardSample hi,
                                          double tolerance) const;
};

// TOMS 748 from Boost.Math, for guards whose slope is not available.

/// Inverse cubic interpolation on the values alone (Alefeld, Potra and Shi, ACM
/// Transactions on Mathematical Software 21, 1995).
struct Toms748 {
    [[nodiscard]] detail::Location locate(GuardPath& path, GuardSample lo, GuardSample hi,
                                          double tolerance) const;
};

}  // namespace ricochet
