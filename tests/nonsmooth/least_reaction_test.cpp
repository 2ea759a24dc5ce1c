// The least of the reactions with the same effect. Sums of four terms are rounded to a few units in
// the last place, and one or two rounds of the method to 1e-14 of the terms: 1e-12 holds both.

#include <gtest/gtest.h>

#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "ricochet/nonsmooth/detail/least_reaction.hpp"

namespace ricochet::detail {
namespace {

constexpr double tolerance = 1e-12;

[[nodiscard]] Eigen::Vector2d least_of_two(double bound, double other, const Eigen::Vector2d& r0)
{
    const LeastReaction<2> least(Eigen::Matrix<double, 1, 2>{1, 1}, 2);
    const Eigen::Vector2d bounds(bound, other);
    Eigen::Vector2d r = r0;
    least.choose(-bounds, bounds, r);
    return r;
}

TEST(LeastReaction, IsSharedEquallyUpToTheBounds)
{
    EXPECT_TRUE(least_of_two(1, 3, {0, -1}).isApprox(Eigen::Vector2d(-0.5, -0.5), tolerance));
    EXPECT_TRUE(least_of_two(1, 3, {0, -3}).isApprox(Eigen::Vector2d(-1, -2), tolerance));
    EXPECT_TRUE(least_of_two(1, 3, {-1, -3}).isApprox(Eigen::Vector2d(-1, -3), tolerance));
    EXPECT_TRUE(least_of_two(2, 2, {2, -2}).isZero(tolerance));
    EXPECT_TRUE(least_of_two(2, 2, {0, 0}).isZero(0));
    const double infinity = std::numeric_limits<double>::infinity();
    EXPECT_TRUE(least_of_two(1, infinity, {1, 7}).isApprox(Eigen::Vector2d(1, 7), tolerance));
    EXPECT_TRUE(least_of_two(5, infinity, {1, 7}).isApprox(Eigen::Vector2d(4, 4), tolerance));
}

TEST(LeastReaction, LeavesReactionsThatAreFixedAlone)
{
    const LeastReaction<2> least(Eigen::Matrix<double, 1, 2>{1, 1}, 2);
    Eigen::Vector2d r(-1, 1);
    least.choose({-1, -3}, {-1, 3}, r);
    EXPECT_EQ(r, Eigen::Vector2d(-1, 1));
}

TEST(LeastReaction, DependsOnColumnsThatDo)
{
    EXPECT_TRUE(LeastReaction<2>(Eigen::Matrix2d{{1, 2}, {2, 4}}, 2).depend());
    EXPECT_FALSE(LeastReaction<2>(Eigen::Matrix2d{{1, 2}, {2, 1}}, 2).depend());
    // The second column belongs to no reaction.
    EXPECT_FALSE(LeastReaction<2>(Eigen::Matrix2d{{1, 0}, {2, 0}}, 1).depend());
    EXPECT_FALSE(LeastReaction<2>().depend());
}

TEST(LeastReaction, IsTheSameFromAnyReactionWithTheSameEffect)
{
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int i = 0; i < 1000; ++i) {
        SCOPED_TRACE(i);
        Eigen::Matrix<double, 2, 4> act;
        for (double& g : act.reshaped()) g = std::round(3 * uniform(random));
        if (act.isZero(0)) continue;
        Eigen::Vector4d lower, upper, start, direction;
        for (int k = 0; k < 4; ++k) {
            lower[k] = -std::abs(uniform(random));
            upper[k] = std::abs(uniform(random));
            start[k] = std::clamp(2 * uniform(random), lower[k], upper[k]);
            direction[k] = uniform(random);
        }
        const LeastReaction<4> least(act, 4);
        ASSERT_TRUE(least.depend());
        Eigen::Vector4d r = start;
        least.choose(lower, upper, r);
        EXPECT_TRUE((act * (r - start)).isZero(tolerance));
        EXPECT_TRUE((r - lower).minCoeff() >= -tolerance && (upper - r).minCoeff() >= -tolerance);
        // From another one: on the way to it none is less.
        direction -= act.transpose() * act.transpose().fullPivHouseholderQr().solve(direction);
        double length = 1;
        for (int k = 0; k < 4; ++k) {
            const double bound = direction[k] > 0 ? upper[k] : lower[k];
            if (direction[k] != 0) length = std::min(length, (bound - start[k]) / direction[k]);
        }
        Eigen::Vector4d other = start + std::max(length, 0.0) * direction;
        EXPECT_GE(r.dot(other - r), -tolerance);
        EXPECT_GE(r.dot(start - r), -tolerance);
        least.choose(lower, upper, other);
        EXPECT_TRUE((other - r).isZero(1e-9)) << other.transpose() << " and " << r.transpose();
    }
}

}  // namespace
}  // namespace ricochet::detail
