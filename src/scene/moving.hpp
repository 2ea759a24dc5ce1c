// First contacts with motions that are known only by bounds: the gap is followed in steps over
// which these bounds prove it open.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "scene/motion.hpp"
#include "scene/world.hpp"

namespace ricochet::detail {

struct GapAndRate {
    double gap = 0;
    double rate = 0;
};

/// A gap at one time, and what is known of it.
struct OpenGap {
    double gap = 0;
    double rate = 0;
    double noise = 0;   ///< rates up to this are rounding
    double closed = 0;  ///< gaps up to this are closed
};

/// The time at which a gap closes.
struct Closing {
    double after = never;
    bool opened = false;  ///< whether it has been more than closed before, or its rate has jumped
};

/// The first s in [0, until] at which a gap is closed and closes further. `pair` has
///
///     look(s)       evaluates the gap at s
///     safe(gap)     [s] time after the last evaluation in which an open gap provably stays open
///     linger(gap)   [s] the same for a closed gap, until it can be exceeded by as much again
///     next_jump(s)  next time at which the rate may jump; the bounds hold up to there
///
/// With a bound on second derivatives the steps converge to a root as Newton's method does, and
/// never pass one.
template <class Pair>
[[nodiscard]] Closing first_closing(double until, Pair& pair)
{
    bool opened = false;
    double s = 0;
    for (;;) {
        const OpenGap now = pair.look(s);
        if (!std::isfinite(now.gap + now.rate)) return {};
        // One that closes from the start is struck, however small it is.
        opened = opened || now.gap > 4 * now.closed || (s == 0 && now.rate < -now.noise);
        const bool closed = now.gap <= now.closed;
        const double ahead = closed ? pair.linger(now) : pair.safe(now);
        // Until it may be closed again, a gap that opens at this rate has opened by a quarter of
        // their product at least.
        opened = opened || (closed && now.rate * ahead > 16 * now.closed);
        if ((closed || !(s + ahead > s)) && now.rate < -now.noise) return {s, opened};
        const double jump = pair.next_jump(s);
        const double next = std::max(std::min(s + ahead, jump), std::nextafter(s, never));
        opened = opened || next >= jump;
        if (!(next <= until) || !(next < never)) return {};
        s = next;
    }
}

/// The second derivative of a gap that is not known.
struct UnknownBend {
    double operator()(double /*s*/) const noexcept
    {
        return std::numeric_limits<double>::quiet_NaN();
    }
};

/// The root of a gap, corrected to the exact motion. `gap` returns the gap at a time and its rate,
/// `bend` the second derivative of the polynomial that it is close to: with it, the correction is
/// of third order (Chebyshev's method).
template <class Gap, class Bend = UnknownBend>
[[nodiscard]] double on_map(double after, double until, const Gap& gap, const Bend& bend = {})
{
    for (int i = 0; i < 3; ++i) {
        const auto [value, rate] = gap(after);
        if (!(rate < 0)) break;
        const double change = -value / rate;
        // The map differs from the polynomial by the error of a step.
        if (std::fabs(change) > 0.1 * until) break;
        const double second = -0.5 * bend(after) * change * change / rate;
        const double part = change / after;
        after += std::isnan(second) ? change : change + second;
        after = std::clamp(after, 0.0, until);
        // Newton's method doubles the digits: the next change would be below rounding.
        if (std::fabs(change) <= 1e-9 * after) break;
        // What Chebyshev's leaves is of third order, or from the difference in bend of two motions
        // that are `value` apart, of the size of value / after^2.
        const double left =
            2 * second * second / std::fabs(change) + 10 * part * part * std::fabs(change);
        if (left <= 0.25 * epsilon * after) break;
    }
    return after;
}

/// Position along a path after s seconds, and its first derivative.
[[nodiscard]] inline Vector2 along_path(const Path& path, double s) noexcept
{
    Vector2 sum = path.c[4];
    for (std::size_t k = 4; k-- > 0;) sum = s * sum + path.c[k];
    return sum;
}
[[nodiscard]] inline Vector2 rate_of_path(const Path& path, double s) noexcept
{
    Vector2 sum = 4 * path.c[4];
    for (std::size_t k = 4; k-- > 1;) sum = s * sum + static_cast<double>(k) * path.c[k];
    return sum;
}

/// Bound of the second derivative along a path [m/s^2].
[[nodiscard]] inline double acceleration_of(const Path& path) noexcept
{
    double sum = 2 * norm(path.c[2]);
    if (path.degree > 2) {
        sum += path.until * (6 * norm(path.c[3]) + 12 * path.until * norm(path.c[4]));
    }
    return sum;
}

/// The path of one body relative to another one.
[[nodiscard]] inline Path difference(const Path& a, const Path& b) noexcept
{
    Path out;
    out.degree = std::max(a.degree, b.degree);
    out.until = std::min(a.until, b.until);
    for (std::size_t k = 0; k < out.c.size(); ++k) out.c[k] = a.c[k] - b.c[k];
    while (out.degree > 0 && is_zero(out.c[static_cast<std::size_t>(out.degree)])) --out.degree;
    return out;
}

/// Gap between a body at p and a face that is displaced by `moved`.
[[nodiscard]] FaceGap displaced_gap(const Face& face, const Vector2& moved, double radius,
                                    const Vector2& p);

/// First contact of two bodies, at least one of them mapped, in their current steps.
[[nodiscard]] Meeting meet_mapped(const World& world, std::uint32_t i, std::uint32_t j);

/// First contact of a body with a face that moves, before `t_end`.
[[nodiscard]] Meeting meet_moving(const World& world, std::uint32_t i, std::uint32_t face,
                                  const Instant& t_end);

}  // namespace ricochet::detail
