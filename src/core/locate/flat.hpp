// Roots of any order by values alone, where Newton's method converges linearly.
//
// Near a root of order m a guard behaves as sign(u) |u|^m, and its signed power 1/m as u: the
// secant of the powers finds the root as it would for a straight line. The power that
// straightens three samples is found by trial. The reciprocal straightens a pole, which is
// a sign change as well.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "bracket.hpp"
#include "jump.hpp"

namespace ricochet::detail {

/// An offset in a bracket, and the power of the guard whose secant predicts it.
struct PowerRoot {
    double s = 0;
    double power = 0;  ///< 0: the samples fit no power
};

/// Root of the line through two of three samples, in the signed power of their values that
/// comes closest to a straight line through all three.
[[nodiscard]] inline PowerRoot power_root(std::array<GuardSample, 3> samples) noexcept
{
    std::sort(samples.begin(), samples.end(),
              [](const GuardSample& a, const GuardSample& b) { return a.s < b.s; });
    const auto [a, b, c] = samples;
    if (!(a.s < b.s && b.s < c.s)) return {};
    for (const GuardSample& sample : samples) {
        // A start that is counted as on the surface has the smallest value instead of its own.
        const double size = std::fabs(sample.value);
        if (!(size > std::numeric_limits<double>::min() && std::isfinite(size))) return {};
    }
    PowerRoot best;
    double straightest = 0.1;  // of the larger distance; above that no power fits
    for (const double power :
         {1.0, 1.0 / 3, 1.0 / 5, 0.5, 1.0 / 7, 1.0 / 9, 0.25, 2.0, 3.0, -1.0}) {
        const auto straight = [power](double g) {
            return power == 1 ? g : std::copysign(std::pow(std::fabs(g), power), g);
        };
        const double va = straight(a.value);
        const double vb = straight(b.value);
        const double vc = straight(c.value);
        const double on_line = va + (vc - va) * ((b.s - a.s) / (c.s - a.s));
        const double bend = std::fabs(vb - on_line) / std::fabs(vc - va);
        if (!(bend < straightest)) continue;
        straightest = bend;
        // The line through the middle and the nearer of the others.
        const bool first = std::fabs(va) < std::fabs(vc);
        const double s = first ? a.s : c.s;
        const double v = first ? va : vc;
        best = {.s = b.s - vb * ((s - b.s) / (v - vb)), .power = power};
    }
    return best;
}

/// Narrows the bracket by values alone, to `tolerance` or neighbouring doubles; only to
/// `handed_back` if the guard turns out to be a straight line there. Interpolation
/// that does not shrink the bracket is replaced by bisection.
///
/// @param recent  the end that was replaced last
/// @return the largest |g| among the samples, at least 0
[[nodiscard]] inline double narrow_by_values(GuardPath& path, Bracket& bracket, GuardSample recent,
                                             double tolerance, double handed_back)
{
    auto& [lo, hi] = bracket;
    double size = 0;
    int patience = 8;
    int zeros = 0;
    double past = 0;
    double last = recent.s;
    double width_before = hi.s - lo.s;
    for (int count = 1;; ++count) {
        const double width = hi.s - lo.s;
        const double finest = path.finest(hi.s);
        if (width <= std::max(tolerance, finest)) return size;
        const PowerRoot guess = patience > 0 ? power_root({lo, recent, hi}) : PowerRoot{};
        if (guess.power == 1 && width <= handed_back) return size;
        double s = lo.s + width / 2;
        if (hi.value == 0 && zeros < 2) {  // an exact zero: is it the only one?
            s = hi.s - (++zeros == 1 ? 1 : 64) * finest;
        } else if (guess.power != 0) {
            // Converged from one side: sample the other side.
            const double toward = last >= hi.s ? -1 : 1;
            past = std::fabs(guess.s - last) > 2 * finest ? 0 : past > 0 ? 4 * past : finest;
            const double place = guess.s + toward * past;
            if (place > lo.s && place < hi.s) {
                s = place;
            } else if (guess.s >= hi.s || guess.s <= lo.s) {
                const double beside = std::max(past, finest);
                s = guess.s >= hi.s ? hi.s - beside : lo.s + beside;
                past = beside;
            }
        }
        if (s <= lo.s || s >= hi.s) s = lo.s + width / 2;
        if (s <= lo.s || s >= hi.s) return size;  // neighbouring doubles
        const GuardSample sample = path.value(s);
        size = larger(size, sample.value);
        GuardSample& end = path.has_left(sample) ? hi : lo;
        recent = end;
        end = sample;
        last = s;
        if (count % 3 == 0) {
            if (hi.s - lo.s > width_before / 8) --patience;
            width_before = hi.s - lo.s;
        }
    }
}

}  // namespace ricochet::detail
