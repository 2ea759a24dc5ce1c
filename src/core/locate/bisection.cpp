#include "ricochet/locators.hpp"

#include <algorithm>

#include "jump.hpp"

namespace ricochet {

detail::Location Bisection::locate(GuardPath& path, GuardSample lo, GuardSample hi,
                                   double tolerance) const
{
    const double end = hi.s;
    double size = detail::larger(detail::larger(0, lo.value), hi.value);
    while (hi.s - lo.s > std::max(tolerance, path.finest(hi.s))) {
        const double middle = lo.s + (hi.s - lo.s) / 2;
        if (middle <= lo.s || middle >= hi.s) break;
        const GuardSample sample = path.value(middle);
        size = detail::larger(size, sample.value);
        (path.has_left(sample) ? hi : lo) = sample;
    }
    if (detail::jumps(path, lo, hi, size)) return detail::jump_at(path, lo, hi, end);
    return {.lo = lo.s, .hi = hi.s, .root = hi.s, .slope = hi.rate, .error = hi.s - lo.s};
}

}  // namespace ricochet
