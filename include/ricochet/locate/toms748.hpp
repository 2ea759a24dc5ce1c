// TOMS 748 from Boost.Math, for guards whose slope is not to be had.
#pragma once

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <cstdint>

#include "ricochet/detect/step_probe.hpp"
#include "ricochet/locate/jump.hpp"

namespace ricochet {

/// Inverse cubic interpolation on the values alone (Alefeld, Potra and Shi, ACM
/// Transactions on Mathematical Software 21, 1995).
struct Toms748 {
    template <class Probe>
    [[nodiscard]] Location locate(Probe& probe, GuardSample lo, GuardSample hi,
                                  double tolerance) const
    {
        const auto narrow_enough = [&](double a, double b) {
            const double middle = a + (b - a) / 2;
            return b - a <= std::max(tolerance, probe.finest(b)) || middle <= a || middle >= b;
        };
        const double end = hi.s;
        double size = detail::larger(detail::larger(0, lo.value), hi.value);
        const auto sample_at = [&](double s) {
            const GuardSample sample = probe.value(s);
            size = detail::larger(size, sample.value);
            if (probe.has_left(sample)) {
                if (s < hi.s) hi = sample;
            } else if (s > lo.s) {
                lo = sample;
            }
            return sample.value;
        };
        const auto halve = [&] { (void)sample_at(lo.s + (hi.s - lo.s) / 2); };
        // A step that begins on the surface, or a rounding behind it, has no sign there.
        while (probe.has_left(lo) && !narrow_enough(lo.s, hi.s)) halve();
        if (lo.value * hi.value < 0 && std::isfinite(lo.value * hi.value) &&
            !narrow_enough(lo.s, hi.s)) {
            std::uintmax_t iterations = 200;
            boost::math::tools::toms748_solve(sample_at, lo.s, hi.s, lo.value, hi.value,
                                              narrow_enough, iterations);
        }
        // An exact zero ends the search from one side: close the other.
        if (!narrow_enough(lo.s, hi.s)) (void)sample_at(hi.s - probe.finest(hi.s));
        while (!narrow_enough(lo.s, hi.s)) halve();
        if (detail::jumps(probe, lo, hi, size)) return detail::jump_at(probe, lo, hi, end);
        return {.lo = lo.s, .hi = hi.s, .root = hi.s, .slope = hi.rate, .error = hi.s - lo.s};
    }
};

}  // namespace ricochet
