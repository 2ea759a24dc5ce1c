// The numbers by which the engine tells rounding from motion: each with what it is derived from.
// All are parts of something, never lengths of their own: times, states and guards of any unit are
// alike. `scripts/tolerances` changes one after the other and names the tests that fail.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

namespace ricochet::detail::tolerances {

/// Spacing of the doubles at 1.
inline constexpr double ulp = std::numeric_limits<double>::epsilon();

// --- rounding, in units in the last place ---

/// Rounding of a time: an instant and an offset in a step are rounded once each, by half a unit,
/// and a host's sum of them, from which the difference to another is taken, as often again.
inline constexpr double of_time = 4 * ulp;
/// Rounding of a component of a state, as a step leaves it: a sum of up to thirteen stages, in
/// which the roundings of the largest add up like a random walk.
inline constexpr double of_state = 8 * ulp;
/// Rounding of a sum or difference of two such components.
inline constexpr double of_sum = 2 * of_state;
/// Rounding of a location in a step, as a part of its offset, and of a guard there, as a part of
/// its size: the steps to two neighbouring offsets differ by the rounding of eight components.
inline constexpr double of_location = 8 * of_state;

// --- parts of a step ---

/// The part over which a guard is differenced: the cube root of the unit at least, so that rounding
/// and the third derivative weigh the same in a step over which the guard changes by its size.
inline constexpr double of_difference = 1e-5;
inline constexpr double per_difference = 1e5;  ///< the scale over its part
/// The part ahead of an event at which a rate that vanishes is given the sign that it has later: a
/// second derivative is known to a part of 1e-6 there, and its rounding to 1e-10.
inline constexpr double of_heading = 1e-6;
/// A remainder of a step below which it is not a step of its own: the controller's length is known
/// no better than that.
inline constexpr double of_remainder = 1e-6;
/// The part by which events that follow each other have to advance: a location resolves 2^-46 of a
/// step, and a guard that is zero by rounding is so at places which are 2^16 times that apart.
inline constexpr double of_creep = 0x1p-30;
/// The part in which a guard stays at its surface by rounding alone, and the part of its scale in a
/// step up to which it may be there: a test that costs nothing, before the rounding is computed.
/// That is 8 units in the last place of the terms of the guard, which for guards without
/// cancellation is 2^-49 of their scale: terms may be 2^29 times as large as what is left of them
/// in the step. A guard that moves by its scale in the step crosses, if rounding alone decides,
/// within the same part of the step beyond its end.
inline constexpr double by_rounding = 0x1p-20;

// --- how well a guard follows the cubic through the ends of a step ---

/// Deviation up to which a guard agrees with its cubic to nine digits, which is no coincidence: a
/// second evaluation can change nothing.
inline constexpr double of_exact_cubic = 0x1p-30;
/// Deviation up to which a root on the cubic is as close to that of the guard as one on the tangent
/// may be, `straight_part`, half the digits.
inline constexpr double of_cubic_root = 0x1p-26;
/// Deviation up to which a search may start from the cubic.
inline constexpr double of_plain_cubic = 0x1p-16;

// --- motion that is lost in rounding, in roundings of the guard ---

/// Distance from its surface above which a guard does not fade: an error of location puts it there.
inline constexpr double of_fading = 1024;
/// Drift that stands out from rounding, so that a longer one need not be watched: the parts of a
/// step over which it is watched grow by 16, and the drift by the square.
inline constexpr double of_drift = 0x1p20;

// --- numbers ---

/// Components of the largest state whose remainders are kept: larger ones are not copied.
inline constexpr std::size_t remembered_components = 64;
/// Events of one guard at an instant after which the instant counts as endless. An avalanche has
/// one of each of its guards.
inline constexpr std::uint32_t events_at_instant = 1000;

}  // namespace ricochet::detail::tolerances
