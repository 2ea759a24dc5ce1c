// Random numbers that are the same on every machine.
//
// The distributions of <random> differ between standard libraries; a training
// that must be repeatable to the bit needs its own. The generator is
// xoshiro256** (Blackman and Vigna, 2021), seeded through splitmix64.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "ricochet/base/detail/splitmix.hpp"

namespace ricochet::learn {

/// A stream of random numbers; a value, so that a copy repeats the stream.
class Random {
public:
    using State = std::array<std::uint64_t, 4>;

    /// Starts the stream of a seed.
    explicit constexpr Random(std::uint64_t seed) noexcept
    {
        ricochet::detail::SplitMix words(seed);
        for (std::uint64_t& word : state_) word = words.bits();
    }

    /// Continues a stream from a `state()`.
    explicit constexpr Random(const State& state) noexcept : state_(state) {}

    [[nodiscard]] constexpr const State& state() const noexcept { return state_; }

    /// 64 random bits.
    constexpr std::uint64_t bits() noexcept
    {
        const std::uint64_t result = std::rotl(state_[1] * 5, 7) * 9;
        const std::uint64_t shifted = state_[1] << 17U;
        state_[2] ^= state_[0];
        state_[3] ^= state_[1];
        state_[1] ^= state_[2];
        state_[0] ^= state_[3];
        state_[2] ^= shifted;
        state_[3] = std::rotl(state_[3], 45);
        return result;
    }

    /// Uniform in [0, 1), a multiple of 2^-53.
    constexpr double uniform() noexcept { return static_cast<double>(bits() >> 11U) * 0x1p-53; }

    /// Uniform in [lower, upper].
    constexpr double uniform(double lower, double upper) noexcept
    {
        return lower + (upper - lower) * uniform();
    }

    /// Uniform in the logarithm, in [lower, upper]; 0 < lower <= upper.
    double log_uniform(double lower, double upper) noexcept
    {
        return lower * std::exp(std::log(upper / lower) * uniform());
    }

    /// Uniform in {0, ..., n - 1}; n > 0. The bias, n 2^-53, is below any use here.
    constexpr std::size_t below(std::size_t n) noexcept
    {
        return static_cast<std::size_t>(uniform() * static_cast<double>(n));
    }

    /// Draws from the standard normal distribution (Box and Muller, 1958, the cosine of the pair).
    double normal() noexcept
    {
        const double radius = std::sqrt(-2 * std::log(1 - uniform()));
        return radius * std::cos(2 * std::numbers::pi * uniform());
    }

    /// True with probability `share`.
    constexpr bool chance(double share) noexcept { return uniform() < share; }

private:
    State state_{};
};

/// A random permutation of {0, ..., n - 1} (Fisher and Yates).
[[nodiscard]] inline std::vector<std::size_t> permutation(std::size_t n, Random& random)
{
    std::vector<std::size_t> order(n);
    for (std::size_t i = 0; i < n; ++i) order[i] = i;
    for (std::size_t i = n; i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
    return order;
}

}  // namespace ricochet::learn
