// Internal: the declarations of this header may change without notice.
//
// Detects runs of inclusions that hardly advance.
#pragma once

#include <cstdint>

namespace ricochet::detail {

/// Whether a number of steps in a row advances a run by less than 1e-9 of its span.
class StallWatch {
public:
    StallWatch() = default;
    /// @param most  that number; 0: never
    StallWatch(double t, double t_end, std::uint64_t most) noexcept
        : t_(t), least_(1e-9 * (t_end - t)), most_(most), due_(most)
    {
    }

    /// Called at time t, after that many steps.
    [[nodiscard]] bool operator()(double t, std::uint64_t steps) noexcept
    {
        if (!is_due(steps)) return false;
        const bool stalls = t - t_ < least_;
        due_ = steps + most_;
        t_ = t;
        return stalls;
    }

    /// Whether it compares times after that many steps.
    [[nodiscard]] bool is_due(std::uint64_t steps) const noexcept
    {
        return most_ != 0 && steps >= due_;
    }

private:
    double t_ = 0, least_ = 0;
    std::uint64_t most_ = 0, due_ = 0;
};

}  // namespace ricochet::detail
