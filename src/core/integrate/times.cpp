#include "ricochet/times.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/require.hpp"

namespace ricochet {

Times::Times(std::vector<double> entries, const std::string& name) : entries_(std::move(entries))
{
    for (std::size_t i = 0; i < entries_.size(); ++i) {
        if (entries_[i] == entries_[i]) continue;
        detail::Refuse{name}(fmt::format("entry {} must be a time, got {}", i, entries_[i]));
    }
    std::sort(entries_.begin(), entries_.end());
}

double Times::last_tick(double t) const noexcept
{
    // The quotient is off by rounding, the ticks are not.
    double number = std::floor((t - phase_) / period_);
    if (tick(number) > t) --number;
    if (tick(number + 1) <= t) ++number;
    return number;
}

double Times::next(double t) const noexcept
{
    if (period_ > 0) return tick(last_tick(t) + 1);
    const auto after = std::upper_bound(entries_.begin(), entries_.end(), t);
    return after == entries_.end() ? std::numeric_limits<double>::infinity() : *after;
}

double Times::previous(double t) const noexcept
{
    if (period_ > 0) {
        const double number = last_tick(t);
        return tick(tick(number) < t ? number : number - 1);
    }
    const auto at = std::lower_bound(entries_.begin(), entries_.end(), t);
    return at == entries_.begin() ? -std::numeric_limits<double>::infinity() : *(at - 1);
}

std::size_t Times::count(double t) const noexcept
{
    if (period_ > 0) return tick(last_tick(t)) == t;
    const auto [first, last] = std::equal_range(entries_.begin(), entries_.end(), t);
    return static_cast<std::size_t>(last - first);
}

Times every(double period, double phase, const std::string& name)
{
    const detail::Require require{name};
    require(std::isfinite(period) && period > 0, "period must be positive and finite", period);
    require(std::isfinite(phase), "phase must be finite", phase);
    Times clock;
    clock.period_ = period;
    clock.phase_ = phase;
    return clock;
}

}  // namespace ricochet
