// Do the events of a guard accumulate?
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "ricochet/hybrid/instant.hpp"

namespace ricochet::detail {

/// Recognises accumulating events: three intervals in a row that shrink, and a
/// geometric remainder d q / (1 - q) that is no longer worth resolving. And events
/// that do not advance time at all. Legal event trains, however fast, keep a
/// remainder that is worth resolving.
class ShrinkingIntervals {
public:
    /// Takes note of an event at `t`; true after a hundred in a row that time cannot
    /// tell apart.
    [[nodiscard]] bool stalls(const Instant& t) noexcept
    {
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
        ratio_ = shrinking_ > 0 ? interval / interval_ : 1;
        last_ = t;
        interval_ = interval;
        seen_ = std::min(seen_ + 1, 2u);
        return false;
    }

    /// Whether what is left after the event just noted is below `tolerance` [s] or
    /// the resolution of its time.
    [[nodiscard]] bool accumulate(double tolerance) const noexcept
    {
        return shrinking_ >= 3 && remainder() < std::max(tolerance, resolution());
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
    }

private:
    [[nodiscard]] double resolution() const noexcept
    {
        return 16 * std::numeric_limits<double>::epsilon() * std::fabs(last_.value);
    }

    Instant last_;
    double interval_ = 0;
    double ratio_ = 1;
    std::uint32_t seen_ = 0;
    std::uint32_t shrinking_ = 0;
    std::uint32_t stalled_ = 0;
};

}  // namespace ricochet::detail
