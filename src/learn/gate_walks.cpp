#include "ricochet/learn/detail/gate_walks.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ricochet::learn::detail {

namespace {

// A horizon is a number of steps, whose sum is rounded; `Calibrated` has the same allowance.
constexpr double rounding = 1e-9;

}  // namespace

GateWalks::GateWalks(Model model, const std::vector<double>& shifts)
    : classifier_(std::move(model)), logits_(classifier_.outputs())
{
    for (const double shift : shifts) walks_.push_back({.shift = shift});
    restart();
}

void GateWalks::restart()
{
    asked_.assign(walks_.size(), std::numeric_limits<double>::lowest());
    next_ = asked_;
    earliest_ = next_.front();
}

double GateWalks::cleared(double shift) const noexcept
{
    double value = 0;
    const auto& levels = classifier_.model().levels;
    for (std::size_t k = 0; k < levels.size(); ++k) {
        if (!(logits_[k] < levels[k].threshold - shift)) break;
        value = levels[k].value;
    }
    return value;
}

bool GateWalks::visit(double t, const double* features)
{
    if (t < earliest_) return false;
    bool evaluated = false;
    bool inside = false;
    for (std::size_t i = 0; i < walks_.size(); ++i) {
        if (t < next_[i] - rounding * (next_[i] - asked_[i])) continue;
        if (!std::exchange(evaluated, true)) {
            inside = classifier_.in_domain(features);
            if (inside) classifier_.logits(features, logits_.data());
        }
        ++walks_[i].checks;
        asked_[i] = t;
        next_[i] = t + (inside ? cleared(walks_[i].shift) : 0);
    }
    earliest_ = std::numeric_limits<double>::max();
    for (std::size_t i = 0; i < walks_.size(); ++i) {
        earliest_ = std::min(earliest_, next_[i] - rounding * (next_[i] - asked_[i]));
    }
    return asked_.front() == t;
}

void GateWalks::meet(double event, double back)
{
    ++events_;
    const double shortest = classifier_.model().levels.front().value;
    for (std::size_t i = 0; i < walks_.size(); ++i) {
        const double horizon = next_[i] - asked_[i];
        // A check that comes too late does not see the event.
        if (next_[i] + rounding * horizon >= back) ++walks_[i].misses;
        // The check at the end, and those that halve the horizon until one step is left.
        ++walks_[i].checks;
        if (horizon > shortest) {
            walks_[i].checks +=
                static_cast<std::uint64_t>(std::ceil(std::log2(horizon / shortest))) + 1;
        }
        asked_[i] = next_[i] = event;
    }
    earliest_ = event;
}

}  // namespace ricochet::learn::detail
