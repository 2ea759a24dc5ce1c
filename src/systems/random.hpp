// Random scenes that are the same everywhere: splitmix64 (Steele, Lea and Flood, 2014).
#pragma once

#include <cstdint>

namespace ricochet::detail {

class Random {
public:
    explicit constexpr Random(std::uint64_t seed) noexcept : state_(seed) {}

    /// Uniform in [lower, upper).
    constexpr double uniform(double lower, double upper) noexcept
    {
        state_ += 0x9e3779b97f4a7c15U;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
        z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
        z ^= z >> 31U;
        return lower + (upper - lower) * (static_cast<double>(z >> 11U) * 0x1p-53);
    }

private:
    std::uint64_t state_;
};

}  // namespace ricochet::detail
