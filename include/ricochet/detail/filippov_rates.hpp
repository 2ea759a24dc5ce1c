// Internal: the declarations of this header may change without notice.
//
// Fields that meet at switching surfaces, and the continuation that the rates of the surfaces
// determine.
//
// Region r of four has h_i > 0 for every bit i of r. From a point on some surfaces the
// motion may depart into a region, or along one surface away from another, or stay on
// all of them. The decision uses only the rates dh_i/dt along the fields of adjoining regions.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "ricochet/sliding.hpp"

namespace ricochet::detail {

/// A place for each surface.
using Places = std::array<Place, 2>;

/// The surfaces that a point lies on: bit i for surface i.
using Surfaces = unsigned;

/// rates[i][region]: dh_i/dt along the field of the region [1/s times the unit of
/// h_i]; zero for regions that do not meet at the point.
using RegionRates = std::array<std::array<double, 4>, 2>;

/// The region of a motion that does not slide on any surface.
[[nodiscard]] constexpr unsigned region_of(const Places& places) noexcept
{
    return (places[0] == Place::above ? 1u : 0u) | (places[1] == Place::above ? 2u : 0u);
}

/// The rates of each surface in units of the largest of them.
[[nodiscard]] RegionRates normalised(const RegionRates& rates) noexcept;

/// Shares of the fields on the sides above, in sliding on both surfaces.
struct Shares {
    double first = 0.5;
    double second = 0.5;

    /// Weights of the four regions, bilinear in the shares.
    [[nodiscard]] constexpr std::array<double, 4> weights() const noexcept
    {
        return {(1 - first) * (1 - second), first * (1 - second), (1 - first) * second,
                first * second};
    }
};

/// The shares of a motion: 0 or 1 beside a surface, 1/2 on it.
[[nodiscard]] constexpr Shares middle_of(const Places& at) noexcept
{
    const auto share = [](Place place) {
        return place == Place::above ? 1.0 : place == Place::below ? 0.0 : 0.5;
    };
    return {share(at[0]), share(at[1])};
}

/// The sum over four regions, in an order that does not depend on which surface is
/// called the first.
[[nodiscard]] constexpr double blend(const std::array<double, 4>& weights, double f0, double f1,
                                     double f2, double f3) noexcept
{
    return (weights[0] * f0 + weights[3] * f3) + (weights[1] * f1 + weights[2] * f2);
}

/// The shares at which the rates of both surfaces vanish.
struct SlidingShares {
    Shares shares;
    /// Distance from the point where they cease to exist by merging with another such pair:
    /// the discriminant of the quadratic that they solve, divided by the sum of its terms.
    double apart = 1;
};

/// The zero of both rates that steep switching settles at: of two, the one that is no saddle. If a
/// pair of zeros has just vanished, the place where it vanished. Of surfaces that coincide, the
/// zero on the line on which their shares move together. Where the rates do not determine a share
/// (all fields have the same rate, zero), the zero nearest to (1/2, 1/2).
[[nodiscard]] SlidingShares sliding_shares(const RegionRates& rates) noexcept;

/// Places of a motion that starts on the intersection of two surfaces.
struct Continuation {
    Places to{Place::sliding, Place::sliding};
    double margin = 0;  ///< least of the normalised rates with which it leaves a surface
    Shares at;          ///< the shares with which it leaves
};

/// Follows steep but continuous switching: across an intersection the shares change
/// fast, at the combined rates of their surfaces,
///
///     a' = rate of h_0,  b' = rate of h_1,   (a, b) in the unit square,
///
/// (Alexander and Seidman, Houston J. Math. 24, 1998, use this blend of fields.) If they reach
/// a corner, the motion departs into a region; if they reach the middle of an edge, it
/// departs along one surface; if they stay inside, it slides on both. From an unstable
/// balance both shares are moved up a little.
[[nodiscard]] Continuation follow_shares(const RegionRates& normalised, Shares from) noexcept;

/// Two directions in which the state can be moved, and the rates of both surfaces
/// along them: normal[k][m] for surface k and direction m. Moving the state
///
///     x -= residue_0 d_0 + residue_1 d_1,   with rates of d_m: 1 for surface m, else 0
///
/// removes the residues. The combination is formed by elimination with the largest
/// rate as pivot, one component at a time. Where a surface is one component of the
/// state, minus a constant, that component ends exactly on the surface: quotients that
/// are 1 and differences that are 0 in real arithmetic are so in floating point too.
class Elimination {
public:
    /// Directions are parallel where they differ by less than a part `parallel`.
    Elimination(const std::array<std::array<double, 2>, 2>& normal,
                const std::array<double, 2>& residue, double parallel) noexcept;

    /// One component, given that component of both directions.
    [[nodiscard]] double operator()(double x, double first, double second) const noexcept
    {
        const double main = first_is_pivot_ ? first : second;
        const double other = first_is_pivot_ ? second : first;
        const double unit = main / pivot_;
        const double moved = x - residue_ * unit;
        if (pivot_rest_ == 0) return moved;
        return moved - residue_rest_ * ((other - other_on_pivot_ * unit) / pivot_rest_);
    }

    /// Whether there is a direction at all.
    [[nodiscard]] bool possible() const noexcept { return pivot_ != 0; }

private:
    bool first_is_pivot_;
    double pivot_;
    double residue_;
    double other_on_pivot_;
    double pivot_rest_;  ///< 0: the directions are parallel, and one residue remains
    double residue_rest_;
};

/// Names of modes and of guards by their numbers.
[[nodiscard]] const char* filippov_mode_name(std::size_t surfaces, std::uint32_t mode) noexcept;
[[nodiscard]] const char* filippov_guard_name(std::size_t which) noexcept;

/// @throws std::invalid_argument: the rate is negative or not finite.
void check_restoring_rate(double rate);

}  // namespace ricochet::detail
