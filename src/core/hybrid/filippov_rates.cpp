#include "ricochet/detail/filippov_rates.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace ricochet::detail {

namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// p0 + p1 a + p2 b + p3 a b from values at the corners of the unit square.
struct Bilinear {
    double p0, p1, p2, p3;

    explicit Bilinear(const std::array<double, 4>& corner) noexcept
        : p0(corner[0]),
          p1(corner[1] - corner[0]),
          p2(corner[2] - corner[0]),
          p3((corner[0] + corner[3]) - (corner[1] + corner[2]))
    {
    }
};

/// Determinant of the derivatives of p and q with respect to both unknowns.
[[nodiscard]] double determinant_at(const Bilinear& p, const Bilinear& q, const Shares& at) noexcept
{
    return (p.p1 + p.p3 * at.second) * (q.p2 + q.p3 * at.first) -
           (p.p2 + p.p3 * at.first) * (q.p1 + q.p3 * at.second);
}

/// The common zero of p and q, from the quadratic that remains when the second unknown is
/// eliminated: of two zeros the one with the larger determinant, since the other is a saddle. False
/// if there is none.
[[nodiscard]] bool eliminated_zero(const Bilinear& p, const Bilinear& q,
                                   SlidingShares& best) noexcept
{
    const double c2 = q.p1 * p.p3 - p.p1 * q.p3;
    const double c1 = (q.p0 * p.p3 - p.p0 * q.p3) + (q.p1 * p.p2 - p.p1 * q.p2);
    const double c0 = q.p0 * p.p2 - p.p0 * q.p2;
    const double discriminant = c1 * c1 - 4 * c2 * c0;
    const double root = std::sqrt(std::max(0.0, discriminant));
    const double sum = -0.5 * (c1 + std::copysign(root, c1));

    bool found = false;
    // Where the pair of zeros has become complex, both are taken at their real part.
    const double other = discriminant < 0 ? sum / c2 : c0 / sum;
    for (const double first : {sum / c2, other}) {
        const double by_p = p.p2 + p.p3 * first;
        const double by_q = q.p2 + q.p3 * first;
        const double second = std::fabs(by_p) >= std::fabs(by_q) ? -(p.p0 + p.p1 * first) / by_p
                                                                 : -(q.p0 + q.p1 * first) / by_q;
        const Shares shares{first, second};
        if (std::isfinite(first) && std::isfinite(second) &&
            (!found || determinant_at(p, q, shares) > determinant_at(p, q, best.shares))) {
            best = {shares, discriminant / (c1 * c1 + 4 * std::fabs(c2 * c0))};
            found = true;
        }
    }
    return found;
}

/// 1 if both surfaces have the same normalised rates, -1 if opposite ones: the surfaces coincide,
/// or their shares move as if they did. Otherwise 0.
[[nodiscard]] double common_sign(const RegionRates& r) noexcept
{
    const double sign =
        r[0][0] * r[1][0] + r[0][1] * r[1][1] + r[0][2] * r[1][2] + r[0][3] * r[1][3] < 0 ? -1 : 1;
    for (std::size_t k = 0; k < 4; ++k) {
        if (!(std::fabs(r[1][k] - sign * r[0][k]) <= 0x1p-40)) return 0;
    }
    return sign;
}

/// The shares (1/2 + s, 1/2 + sign s) of surfaces that coincide, where s' = p(s) is at rest and, if
/// there are two such places, returns.
[[nodiscard]] SlidingShares common_zero(const Bilinear& p, double sign) noexcept
{
    const double c0 = p.p0 + 0.5 * (p.p1 + p.p2) + 0.25 * p.p3;
    const double c1 = p.p1 + sign * p.p2 + 0.5 * (1 + sign) * p.p3;
    const double c2 = sign * p.p3;
    const double discriminant = c1 * c1 - 4 * c2 * c0;
    const double terms = c1 * c1 + 4 * std::fabs(c2 * c0);
    const double root = std::sqrt(std::max(0.0, discriminant));
    double s = 0;
    if (c1 <= 0) {
        s = c0 == 0 ? 0 : 2 * c0 / (root - c1);
    } else {
        s = c2 == 0 ? -c0 / c1 : -(c1 + root) / (2 * c2);
    }
    return {{0.5 + s, 0.5 + sign * s}, terms > 0 ? discriminant / terms : 1};
}

/// Values of both bilinear functions, and their derivatives.
struct Linearised {
    std::array<double, 2> value;
    std::array<double, 2> by_first;
    std::array<double, 2> by_second;

    Linearised(const RegionRates& rates, const Shares& shares) noexcept
    {
        const auto weights = shares.weights();
        const double a = shares.first;
        const double b = shares.second;
        for (std::size_t k = 0; k < 2; ++k) {
            const auto& r = rates[k];
            value[k] = blend(weights, r[0], r[1], r[2], r[3]);
            by_first[k] = (1 - b) * (r[1] - r[0]) + b * (r[3] - r[2]);
            by_second[k] = (1 - a) * (r[2] - r[0]) + a * (r[3] - r[1]);
        }
    }

    [[nodiscard]] double determinant() const noexcept
    {
        return by_first[0] * by_second[1] - by_first[1] * by_second[0];
    }
};

/// Takes a Newton step; of least norm if the equations are dependent. Returns its size.
double improve(const RegionRates& rates, Shares& shares) noexcept
{
    const Linearised at(rates, shares);
    const auto& [value, by_first, by_second] = at;
    const double determinant = at.determinant();
    const double square = (by_first[0] * by_first[0] + by_second[1] * by_second[1]) +
                          (by_first[1] * by_first[1] + by_second[0] * by_second[0]);
    if (!(square > 0)) return 0;
    double step_first;
    double step_second;
    if (std::fabs(determinant) > 1e-12 * square) {
        step_first = (value[0] * by_second[1] - value[1] * by_second[0]) / determinant;
        step_second = (value[1] * by_first[0] - value[0] * by_first[1]) / determinant;
    } else {
        step_first = (value[0] * by_first[0] + value[1] * by_first[1]) / square;
        step_second = (value[0] * by_second[0] + value[1] * by_second[1]) / square;
    }
    shares.first -= step_first;
    shares.second -= step_second;
    return std::fabs(step_first) + std::fabs(step_second);
}

// --- following the shares ---

using Point = std::array<double, 2>;  ///< both shares

[[nodiscard]] Point rates_at(const RegionRates& r, const Point& at) noexcept
{
    const auto weights = Shares{at[0], at[1]}.weights();
    return {blend(weights, r[0][0], r[0][1], r[0][2], r[0][3]),
            blend(weights, r[1][0], r[1][1], r[1][2], r[1][3])};
}

/// Whether a share is at its bound and not about to leave it.
[[nodiscard]] bool is_held(double share, double rate) noexcept
{
    return (share == 0 && rate <= 0) || (share == 1 && rate >= 0);
}

[[nodiscard]] Place place_of(double share) noexcept
{
    return share == 0 ? Place::below : share == 1 ? Place::above : Place::sliding;
}

[[nodiscard]] Continuation departure(const Point& at, const Point& rate) noexcept
{
    Continuation result;
    result.margin = 1;
    result.at = {at[0], at[1]};
    for (std::size_t k = 0; k < 2; ++k) {
        result.to[k] = place_of(at[k]);
        if (result.to[k] != Place::sliding) {
            result.margin = std::min(result.margin, std::fabs(rate[k]));
        }
    }
    return result;
}

/// End of the motion of the moving share on the edge on which the other is held: the next
/// equilibrium, or the corner.
[[nodiscard]] double end_of_edge(const RegionRates& r, Point at, std::size_t moving,
                                 double rate) noexcept
{
    const double ahead = rate >= 0 ? 1 : 0;
    const double here = at[moving];
    at[moving] = ahead;
    const double there = rates_at(r, at)[moving];
    if (rate == 0) return there < 0 ? here : ahead;
    if (!(rate * there < 0)) return ahead;
    const double balance = here + (ahead - here) * (rate / (rate - there));
    return std::clamp(balance, 1e-12, 1 - 1e-12);
}

/// Moves along an edge: true if the motion departs on it or at its end, else `at` is the place
/// where it leaves the edge.
[[nodiscard]] bool departs_on_edge(const RegionRates& r, Point& at, std::size_t held,
                                   Continuation& result) noexcept
{
    const std::size_t moving = 1 - held;
    const Point rate = rates_at(r, at);
    Point end = at;
    end[moving] = end_of_edge(r, at, moving, rate[moving]);
    const Point at_end = rates_at(r, end);
    if (is_held(end[held], at_end[held])) {
        result = departure(end, at_end);
        return true;
    }
    // The rate of the held share changes its sign on the edge: a little beyond that place.
    const double turn = rate[held] / (rate[held] - at_end[held]);
    at[moving] += (turn + 1e-3 * (1 - turn)) * (end[moving] - at[moving]);
    return false;
}

[[nodiscard]] bool is_stable(const RegionRates& r, const Point& at) noexcept
{
    const Linearised linear(r, {at[0], at[1]});
    return linear.by_first[0] + linear.by_second[1] <= 0 && linear.determinant() >= 0;
}

/// A step of the midpoint rule, restricted to the square.
[[nodiscard]] Point advanced(const RegionRates& r, const Point& at, const Point& rate) noexcept
{
    constexpr double step = 1.0 / 16;  // rates are at most 1, their derivatives 2
    Point middle;
    for (std::size_t k = 0; k < 2; ++k) {
        middle[k] = std::clamp(at[k] + step / 2 * rate[k], 0.0, 1.0);
    }
    const Point rate_middle = rates_at(r, middle);
    Point next;
    for (std::size_t k = 0; k < 2; ++k) {
        next[k] = std::clamp(at[k] + step * rate_middle[k], 0.0, 1.0);
    }
    return next;
}

/// A linearly implicit step, restricted to the square, that moves the shares by about 1/64: where
/// surfaces almost coincide, both shares hurry to a line along which they are slow. An instability
/// is still followed.
[[nodiscard]] Point advanced_far(const RegionRates& r, const Point& at, const Point& rate) noexcept
{
    const Linearised linear(r, {at[0], at[1]});
    const double half_trace = 0.5 * (linear.by_first[0] + linear.by_second[1]);
    const double split = std::max(0.0, half_trace * half_trace - linear.determinant());
    const double growth = half_trace + std::sqrt(split);
    double step = 1.0 / 64 / std::max(std::fabs(rate[0]), std::fabs(rate[1]));
    if (growth > 0) step = std::min(step, 0.25 / growth);
    const double m00 = 1 - step * linear.by_first[0];
    const double m01 = -step * linear.by_second[0];
    const double m10 = -step * linear.by_first[1];
    const double m11 = 1 - step * linear.by_second[1];
    const double scale = step / (m00 * m11 - m01 * m10);
    const Point moved = {scale * (m11 * rate[0] - m01 * rate[1]),
                         scale * (m00 * rate[1] - m10 * rate[0])};
    // The first bound that is met ends the step: one share alone would leave the line.
    double part = 1;
    for (std::size_t k = 0; k < 2; ++k) {
        const double room = moved[k] > 0 ? 1 - at[k] : at[k];
        if (room > 0) part = std::min(part, room / std::fabs(moved[k]) * (1 + 4 * epsilon));
    }
    return {std::clamp(at[0] + part * moved[0], 0.0, 1.0),
            std::clamp(at[1] + part * moved[1], 0.0, 1.0)};
}

}  // namespace

RegionRates normalised(const RegionRates& rates) noexcept
{
    RegionRates result = rates;
    for (auto& of_surface : result) {
        double largest = 0;
        for (const double rate : of_surface) largest = std::max(largest, std::fabs(rate));
        if (largest > 0) {
            for (double& rate : of_surface) rate /= largest;
        }
    }
    return result;
}

SlidingShares sliding_shares(const RegionRates& rates) noexcept
{
    const RegionRates r = normalised(rates);
    const Bilinear p(r[0]);
    const Bilinear q(r[1]);
    if (const double sign = common_sign(r); sign != 0) return common_zero(p, sign);
    SlidingShares result;
    // The same physical unknown is eliminated whichever surface is called the first.
    if (std::fabs(p.p1) >= std::fabs(q.p2)) {
        SlidingShares zero;
        if (eliminated_zero(p, q, zero)) result = zero;
    } else {
        Bilinear p_swapped = p;
        Bilinear q_swapped = q;
        std::swap(p_swapped.p1, p_swapped.p2);
        std::swap(q_swapped.p1, q_swapped.p2);
        SlidingShares zero;
        if (eliminated_zero(q_swapped, p_swapped, zero)) {
            result = {{zero.shares.second, zero.shares.first}, zero.apart};
        }
    }
    if (result.apart <= 0) return result;  // there is no zero to converge to
    // Two or three steps from the quadratic's zero, a few more from the centre.
    for (int i = 0; i < 20; ++i) {
        if (!(improve(r, result.shares) > 2 * epsilon)) break;
    }
    return result;
}

Continuation follow_shares(const RegionRates& normalised, Shares from) noexcept
{
    constexpr int short_steps = 10000;
    constexpr int most_steps = short_steps + 10000;
    Point at = {std::clamp(from.first, 0.0, 1.0), std::clamp(from.second, 0.0, 1.0)};
    bool pushed = false;
    for (int i = 0; i < most_steps; ++i) {
        const Point rate = rates_at(normalised, at);
        const bool held_first = is_held(at[0], rate[0]);
        const bool held_second = is_held(at[1], rate[1]);
        if (held_first && held_second) return departure(at, rate);
        if (held_first || held_second) {
            Continuation result;
            if (departs_on_edge(normalised, at, held_first ? 0 : 1, result)) return result;
        } else if (std::fabs(rate[0]) + std::fabs(rate[1]) < 1e-9) {
            if (pushed || is_stable(normalised, at)) break;
            for (double& share : at) share = std::min(share + 1e-3, 1.0);
            pushed = true;
        } else {
            at = i < short_steps ? advanced(normalised, at, rate)
                                 : advanced_far(normalised, at, rate);
        }
    }
    return {};
}

Elimination::Elimination(const std::array<std::array<double, 2>, 2>& normal,
                         const std::array<double, 2>& residue, double parallel) noexcept
{
    // Pairs of the same kind are compared before mixed ones, so that surfaces may be renumbered.
    std::size_t k = 0;
    std::size_t m = 0;
    for (const auto& [surface, direction] :
         std::array<std::array<std::size_t, 2>, 4>{{{0, 0}, {1, 1}, {0, 1}, {1, 0}}}) {
        if (std::fabs(normal[surface][direction]) > std::fabs(normal[k][m])) {
            k = surface;
            m = direction;
        }
    }
    first_is_pivot_ = m == 0;
    pivot_ = normal[k][m];
    residue_ = residue[k];
    other_on_pivot_ = normal[k][1 - m];
    const double unit = normal[1 - k][m] / pivot_;
    residue_rest_ = residue[1 - k] - residue_ * unit;
    pivot_rest_ = normal[1 - k][1 - m] - other_on_pivot_ * unit;
    const double size = std::max(std::fabs(normal[1 - k][0]), std::fabs(normal[1 - k][1]));
    if (!(std::fabs(pivot_rest_) > parallel * size)) pivot_rest_ = 0;
}

const char* filippov_mode_name(std::size_t surfaces, std::uint32_t mode) noexcept
{
    static constexpr std::array one = {"below", "above", "sliding"};
    static constexpr std::array two = {"below, below",   "above, below",   "sliding, below",
                                       "below, above",   "above, above",   "sliding, above",
                                       "below, sliding", "above, sliding", "sliding, sliding"};
    if (surfaces == 1) return mode < one.size() ? one[mode] : "unknown";
    return mode < two.size() ? two[mode] : "unknown";
}

const char* filippov_guard_name(std::size_t which) noexcept
{
    static constexpr std::array names = {
        "surface 0 rising", "surface 0 falling", "exit 0 below", "exit 0 above",
        "surface 1 rising", "surface 1 falling", "exit 1 below", "exit 1 above"};
    return which < names.size() ? names[which] : "unknown";
}

void check_restoring_rate(double rate)
{
    if (!(rate >= 0) || !std::isfinite(rate)) {
        throw std::invalid_argument(
            "Filippov: restoring_rate must be finite and not negative, got " +
            std::to_string(rate));
    }
}

}  // namespace ricochet::detail
