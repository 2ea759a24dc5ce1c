// Velocities at random with which bodies leave thermal walls.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "scene/vector2.hpp"

namespace ricochet::detail {

/// Numbers at random that follow from others: each step mixes a number in (splitmix64; G. Steele,
/// D. Lea and C. Flood, Fast splittable pseudorandom number generators, OOPSLA 2014).
class MixedRandom {
public:
    explicit MixedRandom(std::uint64_t seed) : state_(seed) {}

    void mix(double value) noexcept
    {
        state_ ^= std::bit_cast<std::uint64_t>(value + 0.0);  // -0 as 0
        state_ = next();
    }
    /// Uniform in (0, 1].
    [[nodiscard]] double uniform() noexcept
    {
        return (static_cast<double>(next() >> 11) + 1) * 0x1p-53;
    }

private:
    std::uint64_t next() noexcept
    {
        state_ += 0x9e3779b97f4a7c15U;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
        return z ^ (z >> 31);
    }

    std::uint64_t state_;
};

/// [m/s] Components along the normal and across of a body that leaves a wall with this kT / mass
/// [m^2/s^2]: normal to the wall with the density of a flux, v exp(-m v^2 / 2 kT), across it
/// Maxwell's.
[[nodiscard]] inline Vector2 leaving_velocity(MixedRandom& random, double scale) noexcept
{
    const double normal = std::sqrt(-2 * scale * std::log(random.uniform()));
    const double size = std::sqrt(-2 * scale * std::log(random.uniform()));
    return {normal, size * std::cos(2 * std::numbers::pi * random.uniform())};
}

}  // namespace ricochet::detail
