#include "core/resolved_parts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "ricochet/detail/cubic_check.hpp"

namespace ricochet::detail {

void ResolvedParts::resolve(GuardPath& path, std::size_t i, const Watch& watch,
                            double declared_touch, bool everywhere)
{
    const GuardSample& start = watch.start;
    const GuardSample& end = watch.end;
    whole_ = watch;
    if (guard_ == i) return;
    guard_ = i;
    nodes_.clear();
    divided_ = unresolved_ = nearly_cubic_ = false;
    if (!std::isfinite(start.rate) || !std::isfinite(end.rate)) return;
    noise_ = -1;
    declared_touch_ = declared_touch;
    const double smallest = smallest_part * path.h();
    if (!everywhere) return divide(path, start, end, smallest, 0);
    GuardSample from = start;
    const double width = end.s - start.s;
    for (const double u : CubicCheck::places) {
        const GuardSample node = path.dense_value_and_rate(start.s + u * width);
        divide(path, from, node, smallest, 1);
        if (node.value != 0) nodes_.push_back(node);
        from = node;
    }
    divided_ = true;
    divide(path, from, end, smallest, 1);
}

void ResolvedParts::divide(GuardPath& path, const GuardSample& start, const GuardSample& end,
                           double smallest, int depth)
{
    const double width = end.s - start.s;
    const auto cubic_in = [&](double unit) {
        return CubicCheck(start.value / unit, start.rate / unit, end.value / unit, end.rate / unit,
                          width);
    };
    CubicCheck look = cubic_in(1);
    const bool large = !std::isfinite(4 * look.size());  // of which terms may overflow
    const double unit = large ? CubicCheck::large_unit : 1;
    if (large) look = cubic_in(unit);
    double deviation = 0;
    for (const double u : {CubicCheck::inside, CubicCheck::further}) {
        const double e = look.deviation(u, path.dense_value(start.s + u * width).value / unit);
        deviation = e <= deviation ? deviation : e;  // NaN stays
    }
    if (start.s == whole_.start.s && end.s == whole_.end.s) {
        nearly_cubic_ = CubicCheck::most * deviation <= look.size();
    }
    if (look.stays_clear(deviation) || look.keeps_shape(deviation)) return;
    if (look.size() + deviation <= declared_touch_ / unit) return;
    const double at = start.s + cut * width;
    if (width <= smallest || !(at > start.s && at < end.s)) {
        // A kink keeps its shape on any part, however short.
        unresolved_ = unresolved_ || !(deviation <= 0x1p-24 * look.size());
        return;
    }
    // Rounding does not scale; if the guard decays, it is smaller here than where it was asked for.
    if (depth >= shallow && !(noise_ >= 0)) noise_ = path.blur(end.s);
    if (deviation <= noise_ / unit) noise_ = path.blur(end.s);
    if (deviation <= noise_ / unit) return;
    const GuardSample middle = path.dense_value_and_rate(at);
    divided_ = true;
    divide(path, start, middle, smallest, depth + 1);
    // A node that cannot be distinguished from the surface is not used as the end of a part.
    constexpr double ulps = 64 * std::numeric_limits<double>::epsilon();
    const double touch = std::max(declared_touch_, ulps * unit * look.size());
    if (std::fabs(middle.value) > std::max(noise_, touch)) nodes_.push_back(middle);
    divide(path, middle, end, smallest, depth + 1);
}

}  // namespace ricochet::detail
