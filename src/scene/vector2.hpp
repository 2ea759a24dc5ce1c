// Arithmetic in the plane.
//
// Every sum is written so that exchanging two bodies only changes signs: the bits do not depend on
// the order of the two.
#pragma once

#include <cmath>
#include <utility>

#include "ricochet/instant.hpp"
#include "ricochet/scene/scene.hpp"

namespace ricochet::detail {

/// A part of the plane: low <= p < high. Either may be infinite.
struct Square {
    Vector2 low{}, high{};
};

[[nodiscard]] inline Vector2 operator+(const Vector2& a, const Vector2& b) noexcept
{
    return {a[0] + b[0], a[1] + b[1]};
}
[[nodiscard]] inline Vector2 operator-(const Vector2& a, const Vector2& b) noexcept
{
    return {a[0] - b[0], a[1] - b[1]};
}
[[nodiscard]] inline Vector2 operator*(double s, const Vector2& a) noexcept
{
    return {s * a[0], s * a[1]};
}
[[nodiscard]] inline double dot(const Vector2& a, const Vector2& b) noexcept
{
    return a[0] * b[0] + a[1] * b[1];
}
[[nodiscard]] inline double norm(const Vector2& a) noexcept
{
    return std::sqrt(dot(a, a));
}
[[nodiscard]] inline bool is_zero(const Vector2& a) noexcept
{
    return a[0] == 0 && a[1] == 0;
}
[[nodiscard]] inline bool is_slanted(const Vector2& a) noexcept
{
    return a[0] != 0 && a[1] != 0;
}
[[nodiscard]] inline bool is_finite(const Vector2& a) noexcept
{
    return std::isfinite(a[0]) && std::isfinite(a[1]);
}
/// The vector turned by a right angle, counterclockwise.
[[nodiscard]] inline Vector2 turned(const Vector2& a) noexcept
{
    return {-a[1], a[0]};
}

/// |n|^2 - 1 for a vector of length 1 up to rounding, where the sum of squares itself would have
/// lost it.
[[nodiscard]] inline double excess_of_square(const Vector2& n) noexcept
{
    return std::fma(n[0], n[0], std::fma(n[1], n[1], -1.0));
}

/// |a|^2 - |b|^2, also where the difference is a rounding of either.
[[nodiscard]] inline double difference_of_squares(const Vector2& a, const Vector2& b) noexcept
{
    TwoSum sum{0, 0};
    for (const auto& [x, y] : {std::pair{a[0], a[0]}, {b[0], -b[0]}, {a[1], a[1]}, {b[1], -b[1]}}) {
        const TwoSum product = two_product(x, y);
        const TwoSum next = two_sum(sum.value, product.value);
        sum = {next.value, sum.remainder + (next.remainder + product.remainder)};
    }
    return sum.value + sum.remainder;
}

/// The point of the segment from a to b that is nearest to p.
[[nodiscard]] inline Vector2 nearest_on(const Vector2& a, const Vector2& b,
                                        const Vector2& p) noexcept
{
    const Vector2 along = b - a;
    const double length = dot(along, along);
    const double part = length > 0 ? dot(p - a, along) / length : 0;
    return part <= 0 ? a : part >= 1 ? b : a + part * along;
}

/// Cross product of two vectors: positive where b points to the left of a.
[[nodiscard]] inline double cross(const Vector2& a, const Vector2& b) noexcept
{
    return a[0] * b[1] - a[1] * b[0];
}

}  // namespace ricochet::detail
