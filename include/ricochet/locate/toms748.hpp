// TOMS 748 from Boost.Math, for guards whose slope is not to be had.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "ricochet/detect/step_probe.hpp"
#include "ricochet/detail/jump.hpp"

namespace ricochet {

namespace detail {

/// A search by values alone: what it asks of its caller.
struct ValueSearch {
    void* caller;
    double (*value)(void* caller, double s);
    bool (*narrow_enough)(void* caller, double a, double b);
};

/// Narrows [a, b], with values of opposite signs at its ends, by Boost.Math's TOMS 748.
void toms748(const ValueSearch& search, double a, double b, double value_a, double value_b);

}  // namespace detail

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
            auto calls = std::pair(sample_at, narrow_enough);
            using Calls = decltype(calls);
            detail::toms748(
                {.caller = &calls,
                 .value = [](void* caller,
                             double s) { return static_cast<Calls*>(caller)->first(s); },
                 .narrow_enough =
                     [](void* caller, double a, double b) {
                         return static_cast<Calls*>(caller)->second(a, b);
                     }},
                lo.s, hi.s, lo.value, hi.value);
        }
        // An exact zero ends the search from one side: close the other.
        if (!narrow_enough(lo.s, hi.s)) (void)sample_at(hi.s - probe.finest(hi.s));
        while (!narrow_enough(lo.s, hi.s)) halve();
        if (detail::jumps(probe, lo, hi, size)) return detail::jump_at(probe, lo, hi, end);
        return {.lo = lo.s, .hi = hi.s, .root = hi.s, .slope = hi.rate, .error = hi.s - lo.s};
    }
};

}  // namespace ricochet
