// Internal: the declarations of this header may change without notice.
//
// Detects runs of inclusions that hardly advance.
#pragma once

#include <cmath>
#include <cstdint>

namespace ricochet::detail {

/// Whether a number of steps in a row advances a run by less than 1e-9 of its span; of a run
/// without end by less than 1e-6 of the time that it has covered.
class StallWatch {
public:
    StallWatch() = default;
    /// @param most  that number; 0: never
    StallWatch(double t, double t_end, std::uint64_t most) noexcept
        : t_start_(t), t_(t), span_(t_end - t), most_(most), due_(most)
    {
    }

    /// Called at time t, after that many steps.
    [[nodiscard]] bool operator()(double t, std::uint64_t steps) noexcept
    {
        if (!is_due(steps)) return false;
        const double least = std::isinf(span_) ? 1e-6 * (t - t_start_) : 1e-9 * span_;
        const bool stalls = t - t_ < least;
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
    double t_start_ = 0, t_ = 0, span_ = 0;
    std::uint64_t most_ = 0, due_ = 0;
};

}  // namespace ricochet::detail
