#include "ricochet/locators.hpp"

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <cstdint>
#include <limits>

#include "jump.hpp"

namespace ricochet {

namespace {

/// Fraction of the guard at the far end of a bracket below which its value at the near end
/// predicts nothing.
constexpr double negligible_part = 0x1p-10;

}  // namespace

detail::Location Toms748::locate(GuardPath& path, GuardSample lo, GuardSample hi,
                                 double tolerance) const
{
    const auto narrow_enough = [&](double a, double b) {
        const double middle = a + (b - a) / 2;
        return b - a <= std::max(tolerance, path.finest(b)) || middle <= a || middle >= b;
    };
    const double end = hi.s;
    double size = detail::larger(detail::larger(0, lo.value), hi.value);
    const auto sample_at = [&](double s) {
        const GuardSample sample = path.value(s);
        size = detail::larger(size, sample.value);
        if (path.has_left(sample)) {
            if (s < hi.s) hi = sample;
        } else if (s > lo.s) {
            lo = sample;
        }
        return sample.value;
    };
    const auto halve = [&] { (void)sample_at(lo.s + (hi.s - lo.s) / 2); };
    // A step that begins on the surface, or behind it by rounding, has no sign there.
    while (path.has_left(lo) && !narrow_enough(lo.s, hi.s)) halve();
    // After an event the start has a sign, but no value or that of rounding. From there the first
    // secant would lead nowhere, or to noise beside the start, as if the guard crossed once more.
    const auto start_is_negligible = [&] {
        constexpr double least = std::numeric_limits<double>::min();
        return std::fabs(lo.value) <= std::max(least, negligible_part * std::fabs(hi.value));
    };
    while (start_is_negligible() && !narrow_enough(lo.s, hi.s)) halve();
    if (lo.value * hi.value < 0 && std::isfinite(lo.value * hi.value) &&
        !narrow_enough(lo.s, hi.s)) {
        std::uintmax_t iterations = 200;
        boost::math::tools::toms748_solve(sample_at, lo.s, hi.s, lo.value, hi.value, narrow_enough,
                                          iterations);
    }
    // An exact zero ends the search from one side: close the bracket from the other.
    if (!narrow_enough(lo.s, hi.s)) (void)sample_at(hi.s - path.finest(hi.s));
    while (!narrow_enough(lo.s, hi.s)) halve();
    if (detail::jumps(path, lo, hi, size)) return detail::jump_at(path, lo, hi, end);
    return {.lo = lo.s, .hi = hi.s, .root = hi.s, .slope = hi.rate, .error = hi.s - lo.s};
}

}  // namespace ricochet
