// Do the events of a guard accumulate?
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "ricochet/detect/step_probe.hpp"
#include "ricochet/hybrid/instant.hpp"

namespace ricochet::detail {

/// Recognises accumulating events: three intervals in a row that shrink, and a
/// geometric remainder d q / (1 - q) that is no longer worth resolving. And events
/// that do not advance time at all. Legal event trains, however fast, keep a
/// remainder that is worth resolving.
class ShrinkingIntervals {
public:
    /// Takes note of an event at `t`, where a step would be of length `step` [s]; true
    /// after a hundred in a row that time cannot tell apart.
    [[nodiscard]] bool stalls(const Instant& t, double step) noexcept
    {
        step_ = step;
        const double interval =
            std::fabs((t.value - last_.value) + (t.remainder - last_.remainder));
        stalled_ = interval < std::max(resolution(), std::numeric_limits<double>::min()) / 4
                       ? stalled_ + 1
                       : 0;
        if (stalled_ > 100) return true;
        const double instant = std::max(resolution(), std::numeric_limits<double>::min()) / 256;
        if (interval <= instant && seen_ > 0) {  // another event of the same instant: no interval
            last_ = t;
            return false;
        }
        shrinking_ = seen_ >= 2 && interval < interval_ ? shrinking_ + 1 : 0;
        const double ratio = shrinking_ > 0 ? interval / interval_ : 1;
        geometric_ = interval + 4 * resolution() >= interval_ * ratio_ / 16;
        ratio_ = ratio;
        last_ = t;
        interval_ = interval;
        seen_ = std::min(seen_ + 1, 2u);
        return false;
    }

    /// Whether what is left after the event just noted is below `tolerance` [s] or
    /// the resolution of its time. An interval that is far shorter than the ones before
    /// made expect is the gap between two events, not the end of a series.
    [[nodiscard]] bool accumulate(double tolerance) const noexcept
    {
        return shrinking_ >= 3 && geometric_ && remainder() < std::max(tolerance, resolution());
    }

    /// Extrapolated time [s] from the last event to the limit of all.
    [[nodiscard]] double remainder() const noexcept { return interval_ * ratio_ / (1 - ratio_); }

    /// Calls `visit` with every number that makes up the state.
    template <class Visit>
    void visit(Visit&& visit)
    {
        visit(last_.value);
        visit(last_.remainder);
        visit(interval_);
        visit(ratio_);
        visit(seen_);
        visit(shrinking_);
        visit(stalled_);
        visit(step_);
        visit(geometric_);
    }

private:
    [[nodiscard]] double resolution() const noexcept
    {
        return 16 * finest_bracket(last_.value, step_);
    }

    Instant last_;
    double interval_ = 0;
    double ratio_ = 1;
    double step_ = 0;
    bool geometric_ = true;
    std::uint32_t seen_ = 0;
    std::uint32_t shrinking_ = 0;
    std::uint32_t stalled_ = 0;
};

}  // namespace ricochet::detail
