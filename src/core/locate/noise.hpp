// Noise in a guard: scatter that no smooth function has, such as that of float arithmetic.
//
// A bracket cannot be narrowed below the noise, only moved about in it. The presence of noise
// must be beyond doubt, since close roots of a smooth guard change its sign as often; the test is
// by third differences. Over a distance d those of a polynomial of degree n that is at most G in
// a step of length h are below T_n'''(1) G (2 d / h)^3 (V. Markov), which is 4e6 G (d / h)^3
// for n = 14; a kink spoils only the three that straddle it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "bracket.hpp"

namespace ricochet::detail {

/// Level of noise of a guard that reaches |g| = `size` in a step of length `h`.
struct NoiseScale {
    double size = 0;
    double h = 0;

    /// No arithmetic is expected to make noise larger than this fraction of the guard.
    static constexpr double coarsest = 1e-5;
    /// Noise below this fraction is the rounding of doubles, and needs no treatment of its own.
    static constexpr double finest = 1e-10;

    /// Whether a guard in doubles resolves such a change, even if its terms are a hundred
    /// times larger than the guard itself.
    [[nodiscard]] bool resolves(double change) const noexcept
    {
        return std::fabs(change) > 0x1p-46 * size;
    }

    [[nodiscard]] bool may_be(double value) const noexcept
    {
        const double g = std::fabs(value);
        return g >= finest * size && g <= coarsest * size;
    }
};

/// Change of the guard from `at` to the nearest offset with another value: the height of
/// the steps if the guard is a staircase.
[[nodiscard]] inline double tread_height(GuardPath& path, const GuardSample& sample,
                                         const GuardSample& at, const NoiseScale& scale)
{
    double change = 0;
    for (double part = 1e-8; part < 1e-5 && change == 0; part *= 8) {
        change = path.along_the_flow(sample, at.s - part * scale.h).value - at.value;
    }
    return change;
}

/// Distance of b from the parabola through the other three.
[[nodiscard]] inline double off_parabola(const GuardSample& a, const GuardSample& b,
                                         const GuardSample& c, const GuardSample& d) noexcept
{
    const auto slope = [](const GuardSample& p, const GuardSample& q) {
        return (q.value - p.value) / (q.s - p.s);
    };
    const double bend_before = (slope(a, c) - slope(a, b)) / (c.s - b.s);
    const double bend_after = (slope(c, d) - slope(b, c)) / (d.s - b.s);
    return std::fabs((bend_after - bend_before) / (d.s - a.s) * (b.s - a.s) * (b.s - c.s) *
                     (b.s - d.s));
}

/// Steps from an end of the bracket in noise, in multiples of `distance`, to the other side of
/// the surface, and closes the bracket around the change of side; false if there is none nearby.
[[nodiscard]] inline bool reach_across(GuardPath& path, const GuardSample& sample, bool left,
                                       double distance, Bracket& bracket)
{
    GuardSample from = left ? bracket.hi : bracket.lo;
    for (int i = 0; i < 4; ++i) {
        const double s = from.s + (left ? -3 : 3) * distance;
        if (!bracket.contains(s)) return false;
        const GuardSample at = path.along_the_flow(sample, s);
        (path.has_left(at) ? bracket.hi : bracket.lo) = at;
        if (path.has_left(at) != left) return true;
        from = at;
    }
    return false;
}

/// Where a guard may be noise, and of what height.
struct NoisePlace {
    double s = 0;
    double residue = 0;
};

/// If the guard near `place` is noise of about its residue: narrows the bracket to a change of
/// side there, and returns the time [s] over which the noise hides the root; else 0. `sample`
/// is the last sample of `value_and_rate`, from which the motion is taken as straight.
[[nodiscard, gnu::noinline]] inline double close_in_noise(GuardPath& path,
                                                          const GuardSample& sample,
                                                          const NoisePlace& place,
                                                          const NoiseScale& scale, Bracket& bracket)
{
    auto& [lo, hi] = bracket;
    constexpr int places = 8;
    // Unevenly spaced, so that the steps of a staircase do not look like a line.
    constexpr std::array<double, places> offsets{-5, -3.9, -2.3, -0.8, 0.4, 2.1, 3.3, 4.9};
    const double distance = std::fabs(place.residue / sample.rate);
    const double first = place.s + offsets.front() * distance;
    const double last = place.s + offsets.back() * distance;
    if (!(distance > 0 && last > lo.s && first < hi.s)) return 0;
    const double part = distance / scale.h;
    const double smooth = std::max(1e7 * part * part * part, NoiseScale::finest) * scale.size;

    std::array<GuardSample, places> at;
    for (std::size_t i = 0; i < places; ++i) {
        at[i] = path.along_the_flow(sample, place.s + offsets[i] * distance);
        if (!(std::fabs(at[i].value) <= 10 * NoiseScale::coarsest * scale.size)) return 0;
    }
    int rough = 0;
    double noise = 0;
    for (std::size_t i = 0; i + 3 < places; ++i) {
        const double bend = off_parabola(at[i], at[i + 1], at[i + 2], at[i + 3]);
        rough += bend > smooth;
        noise = std::max(noise, bend);
    }
    if (rough < 4) return 0;

    double returned = first;
    bool crossed = false;
    for (const GuardSample& value : at) {
        const bool left = path.has_left(value);
        if (!left) returned = std::max(returned, value.s);
        if (crossed || !bracket.contains(value.s)) continue;
        crossed = left;
        (left ? hi : lo) = value;
    }
    const bool near = bracket.width() <= 4 * distance;
    if (!near && !reach_across(path, sample, path.has_left(crossed ? hi : lo), distance, bracket)) {
        return 0;
    }
    return std::max(returned - lo.s, noise / std::fabs(sample.rate));
}

}  // namespace ricochet::detail
