// Internal: the declarations of this header may change without notice.
//
// Random numbers for scenes and seeds that are the same on every machine: splitmix64 (Steele, Lea
// and Flood, 2014).
#pragma once

#include <cstdint>

namespace ricochet::detail {

class SplitMix {
public:
    explicit constexpr SplitMix(std::uint64_t seed) noexcept : state_(seed) {}

    /// 64 random bits.
    constexpr std::uint64_t bits() noexcept
    {
        state_ += 0x9e3779b97f4a7c15U;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
        z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
        return z ^ (z >> 31U);
    }

    /// Uniform in [lower, upper).
    constexpr double uniform(double lower, double upper) noexcept
    {
        return lower + (upper - lower) * (static_cast<double>(bits() >> 11U) * 0x1p-53);
    }

private:
    std::uint64_t state_;
};

}  // namespace ricochet::detail
