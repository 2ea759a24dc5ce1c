// Convex sets: values of projections and derivatives, and the refusal of functions that are no
// projections. The common properties of sets are in conformance/convex_sets.hpp.

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <vector>

#include "ricochet/nonsmooth/inclusion.hpp"

namespace ricochet::sets_test {
namespace {

using namespace sets;

template <class Set>
std::vector<double> projected(const Set& set, std::vector<double> z)
{
    set.project(z, z);
    return z;
}

template <class Set>
std::vector<double> derivative(const Set& set, const std::vector<double>& z)
{
    std::vector<double> d(z.size() * z.size(), -7);
    set.derivative(z, d);
    return d;
}

using Values = std::vector<double>;

TEST(ConvexSets, AnIntervalClampsAndItsSlopeIsOneHalfOnABound)
{
    const IntervalSet sign = IntervalSet::symmetric(1);
    EXPECT_EQ(projected(sign, {3}), Values{1});
    EXPECT_EQ(projected(sign, {-3}), Values{-1});
    EXPECT_EQ(projected(sign, {0.25}), Values{0.25});
    EXPECT_EQ(derivative(sign, {3}), Values{0});
    EXPECT_EQ(derivative(sign, {0.25}), Values{1});
    EXPECT_EQ(derivative(sign, {1}), Values{0.5});
    EXPECT_EQ(derivative(sign, {-1}), Values{0.5});
    // A bound of zero is the point zero, whose projection does not vary.
    EXPECT_EQ(derivative(IntervalSet::symmetric(0), {0}), Values{0});
    EXPECT_EQ(projected(IntervalSet::symmetric(0), {0.3}), Values{0});
}

TEST(ConvexSets, ABallKeepsDirections)
{
    const Ball<2> disk(2);
    EXPECT_EQ(projected(disk, {3, 4}), (Values{3 * (2.0 / 5), 4 * (2.0 / 5)}));
    EXPECT_EQ(projected(disk, {1, -1}), (Values{1, -1}));
    // At (r, 0) with |r| > 2 the radial slope is 0 and the other 2 / |r|.
    EXPECT_EQ(derivative(disk, {4, 0}), (Values{0, 0, 0, 0.5}));
    EXPECT_EQ(derivative(Ball<2>(0), {0, 0}), (Values{0, 0, 0, 0}));
    // Squares of components this large would overflow.
    EXPECT_NEAR(projected(disk, {3e200, 4e200})[0], 1.2, 1e-15);
}

TEST(ConvexSets, AFrictionConeHasAnInsideAPolarAndASide)
{
    const FrictionCone<3> cone(0.5);
    EXPECT_EQ(projected(cone, {2, 0.6, 0.8}), (Values{2, 0.6, 0.8}));
    EXPECT_EQ(projected(cone, {-2, 0.6, 0.8}), (Values{0, 0, 0}));
    // Side: s = (0 + 0.5 * 5) / 1.25 = 2, tangent 0.5 * 2 along (3, 4) / 5.
    const Values side = projected(cone, {0, 3, 4});
    EXPECT_NEAR(side[0], 2, 1e-15);
    EXPECT_NEAR(side[1], 0.6, 1e-15);
    EXPECT_NEAR(side[2], 0.8, 1e-15);
    // At the tip the face is the point itself or the whole cone; the point is taken.
    EXPECT_EQ(derivative(cone, {0, 0, 0}), Values(9, 0.0));
    // Without friction it is the half line of the normal.
    EXPECT_EQ(projected(FrictionCone<3>(0), {2, 1, 1}), (Values{2, 0, 0}));
}

TEST(ConvexSets, AFrictionConeMayBeAlmostAHalfSpace)
{
    // The square of this coefficient overflows.
    const FrictionCone<3> cone(1e200);
    EXPECT_EQ(projected(cone, {-1, 3, 4}), (Values{5e-200, 3, 4}));
    const Values d = derivative(cone, {-1, 3, 4});
    for (std::size_t i = 1; i < 3; ++i) {
        for (std::size_t j = 1; j < 3; ++j) EXPECT_NEAR(d[i * 3 + j], i == j ? 1 : 0, 1e-15);
    }
    EXPECT_NO_THROW(check_projection(cone));
    EXPECT_EQ(cone.fault(), "");
    const FrictionCone<3> infinite(std::numeric_limits<double>::infinity());
    EXPECT_EQ(infinite.fault(), "has an infinite coefficient of friction");
}

TEST(ConvexSets, AProductTreatsItsFactorsApart)
{
    const Product product(IntervalSet(0, 1), Ball<2>(1), IntervalSet::half_line());
    EXPECT_EQ(product.dimension(), 4U);
    EXPECT_EQ(projected(product, {2, 0, 3, -1}), (Values{1, 0, 1, 0}));
    const Values d = derivative(product, {0.5, 4, 0, 2});
    Values expected(16, 0.0);
    expected[0] = 1;             // inside [0, 1]
    expected[2 * 4 + 2] = 0.25;  // across the ray at distance 4 from a unit ball
    expected[3 * 4 + 3] = 1;     // inside the half line
    EXPECT_EQ(d, expected);
    const Product box(IntervalSet(0, 1), IntervalSet(-2, 3));
    static_assert(BoxSet<decltype(box)>);
    static_assert(!BoxSet<decltype(product)>);
    EXPECT_EQ(box.lower(1), -2);
    EXPECT_EQ(box.upper(1), 3);
}

// The nearer of two points: idempotent, but no convex set.
struct TwoPoints {
    static std::size_t dimension() { return 1; }
    static void project(std::span<const double> z, std::span<double> p)
    {
        p[0] = z[0] < 0 ? -1 : 1;
    }
    static void derivative(std::span<const double>, std::span<double> d) { d[0] = 0; }
};

// Half way to an interval: a contraction, but not idempotent.
struct HalfWay {
    static std::size_t dimension() { return 1; }
    static void project(std::span<const double> z, std::span<double> p) { p[0] = z[0] / 2; }
    static void derivative(std::span<const double>, std::span<double> d) { d[0] = 0.5; }
};

// A disk that is reached along one axis: idempotent, not the nearest point.
struct Slanted {
    static std::size_t dimension() { return 2; }
    static void project(std::span<const double> z, std::span<double> p)
    {
        p[0] = z[0] + 3 * z[1];
        p[1] = 0;
    }
    static void derivative(std::span<const double>, std::span<double> d)
    {
        d[0] = 1, d[1] = 3, d[2] = d[3] = 0;
    }
};

struct WrongSlope : IntervalSet {
    WrongSlope() : IntervalSet(-1, 1) {}
    static void derivative(std::span<const double>, std::span<double> d) { d[0] = 0.5; }
};

TEST(ConvexSets, WhatIsNoProjectionIsRefused)
{
    EXPECT_THROW(check_projection(TwoPoints{}), std::invalid_argument);
    EXPECT_THROW(check_projection(HalfWay{}), std::invalid_argument);
    EXPECT_THROW(check_projection(Slanted{}), std::invalid_argument);
    EXPECT_THROW(check_projection(WrongSlope{}), std::invalid_argument);
}

TEST(ConvexSets, ASetThatDoesNotSayHasNoFault)
{
    EXPECT_EQ(fault_of(TwoPoints{}), "");
}

}  // namespace
}  // namespace ricochet::sets_test
