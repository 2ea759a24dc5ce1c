// Conformance suite of convex sets.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/nonsmooth/inclusion.hpp"

namespace ricochet::test {

using Vector = std::vector<double>;

/// A set behind functions; `unit` is the power of two by which all its lengths are multiplied.
struct AnySet {
    std::size_t dimension = 0;
    std::function<void(std::span<const double>, std::span<double>)> project{}, derivative{};
    std::function<void()> check{};  ///< `check_projection`
    std::string fault{};
    std::vector<std::array<double, 2>> box{};  ///< bounds, of a box
};

template <ConvexSet Set>
[[nodiscard]] AnySet any_set(const Set& set)
{
    AnySet any{.dimension = set.dimension(),
               .project = [=](auto z, auto p) { set.project(z, p); },
               .derivative = [=](auto z, auto d) { set.derivative(z, d); },
               .check = [=] { check_projection(set); },
               .fault = std::string(fault_of(set))};
    if constexpr (BoxSet<Set>) {
        for (std::size_t i = 0; i < any.dimension; ++i) {
            any.box.push_back({set.lower(i), set.upper(i)});
        }
    }
    return any;
}

/// A set with its properties, given by formulas different from its own.
struct SetCase {
    std::string name;
    std::function<AnySet(double unit)> make;
    /// Amount by which a point violates the set's inequalities; 0 or less inside it.
    std::function<double(const Vector&)> violation;
    /// sup of n.x over the set, infinite where it is not bounded. Directions outside the cone of
    /// finite values only by rounding, relative to the length of n, count as 0.
    std::function<double(const Vector& n)> support;
    std::vector<Vector> kinks{};  ///< points where the projection has no derivative
};

inline void PrintTo(const SetCase& set, std::ostream* out)
{
    *out << set.name;
}

[[nodiscard]] inline double dot(const Vector& a, const Vector& b)
{
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
}

[[nodiscard]] inline double length(const Vector& a)
{
    return std::sqrt(dot(a, a));
}

[[nodiscard]] inline Vector less(Vector a, const Vector& b)
{
    for (std::size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
    return a;
}

class ConvexSetSuite : public testing::TestWithParam<SetCase> {
protected:
    /// Rounding of a projection, relative to the lengths that enter it.
    static constexpr double rounding = 1e-14;

    [[nodiscard]] std::size_t dimension() const { return set_.dimension; }

    [[nodiscard]] Vector projected(const Vector& z) const
    {
        Vector p(z.size());
        set_.project(z, p);
        return p;
    }

    [[nodiscard]] Vector derivative(const Vector& z) const
    {
        Vector d(z.size() * z.size(), -7);
        set_.derivative(z, d);
        return d;
    }

    /// A point with a length from 1e-3 to 1e3, sometimes with some zeros.
    [[nodiscard]] Vector point()
    {
        std::normal_distribution normal;
        const double size = std::pow(10, std::uniform_real_distribution(-3., 3.)(random_));
        Vector z(dimension());
        for (double& x : z) x = random_() % 12 == 0 ? 0 : size * normal(random_);
        return z;
    }

    [[nodiscard]] Vector direction()
    {
        std::normal_distribution normal;
        Vector v(dimension());
        for (double& x : v) x = normal(random_);
        const double size = length(v);
        for (double& x : v) x /= size;
        return v;
    }

    /// Calls check(z) with random points and with the kinks.
    template <class Check>
    void for_points(Check&& check, int points = 2000)
    {
        for (const Vector& z : GetParam().kinks) check(z);
        for (int i = 0; i < points && !HasFailure(); ++i) check(point());
    }

    const AnySet set_ = GetParam().make(1);

private:
    std::mt19937_64 random_{31};
};

TEST_P(ConvexSetSuite, AProjectionLiesInTheSet)
{
    for_points([&](const Vector& z) {
        EXPECT_LE(GetParam().violation(projected(z)), rounding * length(z))
            << testing::PrintToString(z);
    });
}

TEST_P(ConvexSetSuite, APointOfTheSetStaysWhereItIs)
{
    int inside = 0;
    for_points([&](const Vector& z) {
        if (!(GetParam().violation(z) < 0)) return;
        ++inside;
        EXPECT_EQ(projected(z), z);
    });
    EXPECT_GT(inside, 10);
}

TEST_P(ConvexSetSuite, AProjectionProjectedStaysWhereItIs)
{
    for_points([&](const Vector& z) {
        const Vector p = projected(z);
        EXPECT_LE(length(less(projected(p), p)), rounding * length(z));
    });
}

TEST_P(ConvexSetSuite, ItIsTheNearestPoint)
{
    // (z - P z).(y - P z) <= 0 for every y of the set.
    for_points([&](const Vector& z) {
        const Vector p = projected(z);
        for (int k = 0; k < 5; ++k) {
            const Vector y = projected(point());
            EXPECT_LE(dot(less(z, p), less(y, p)), rounding * length(z) * (length(z) + length(y)))
                << testing::PrintToString(z) << testing::PrintToString(y);
        }
    });
}

TEST_P(ConvexSetSuite, PointsComeNoFartherApart)
{
    // |P z - P y|^2 <= (P z - P y).(z - y), and so at most |z - y|^2.
    for_points([&](const Vector& z) {
        Vector y = point();
        if (length(y) < length(z)) {  // in about half the cases near one another
            for (std::size_t i = 0; i < y.size(); ++i) y[i] = z[i] + 1e-3 * y[i];
        }
        const Vector change = less(projected(z), projected(y));
        const Vector apart = less(z, y);
        const double size = length(z) + length(y);
        EXPECT_LE(length(change), length(apart) + rounding * size);
        EXPECT_LE(dot(change, change), dot(change, apart) + rounding * size * size);
    });
}

TEST_P(ConvexSetSuite, WhatIsCutOffIsNormalToTheSet)
{
    // n is in the normal cone at p where n.p is the support function of n.
    for_points([&](const Vector& z) {
        const Vector p = projected(z);
        const Vector n = less(z, p);
        if (length(n) <= 1e-9 * length(z)) return;  // inside, or cancelled
        EXPECT_NEAR(dot(n, p), GetParam().support(n), 1e-13 * length(z) * (1 + length(z)))
            << testing::PrintToString(z);
    });
}

TEST_P(ConvexSetSuite, TheDerivativeIsThatOfDifferences)
{
    // Where forward and backward differences agree there is no kink between; over 1e-6 of the
    // length curvature changes them by that fraction, and rounding by 1e-10.
    int compared = 0;
    for_points([&](const Vector& z) {
        const double size = length(z);
        if (size == 0) return;
        const Vector v = direction();
        const double h = 1e-6 * size;
        Vector ahead = z, behind = z;
        for (std::size_t i = 0; i < z.size(); ++i) ahead[i] += h * v[i], behind[i] -= h * v[i];
        const Vector p = projected(z);
        const Vector forward = less(projected(ahead), p), backward = less(p, projected(behind));
        if (length(less(forward, backward)) > 1e-3 * h) return;
        ++compared;
        const Vector d = derivative(z);
        Vector along(z.size(), 0.0);
        for (std::size_t i = 0; i < z.size(); ++i) {
            for (std::size_t j = 0; j < z.size(); ++j) along[i] += d[i * z.size() + j] * v[j];
            EXPECT_NEAR(along[i], (forward[i] + backward[i]) / (2 * h), 1e-5)
                << testing::PrintToString(z) << testing::PrintToString(v);
        }
    });
    EXPECT_GT(compared, 1000);
}

TEST_P(ConvexSetSuite, EveryDerivativeIsSymmetricAndBetweenZeroAndOne)
{
    // For each face's projection, and so for means of them: v.D v >= |D v|^2 >= 0.
    for_points([&](const Vector& z) {
        const std::size_t n = z.size();
        const Vector d = derivative(z);
        const Vector v = direction();
        Vector along(n, 0.0);
        for (std::size_t i = 0; i < n; ++i) {
            for (std::size_t j = 0; j < n; ++j) {
                EXPECT_NEAR(d[i * n + j], d[j * n + i], 1e-15);
                along[i] += d[i * n + j] * v[j];
            }
        }
        EXPECT_GE(dot(v, along), dot(along, along) - 1e-14) << testing::PrintToString(z);
    });
}

TEST_P(ConvexSetSuite, APointMayBeProjectedInPlace)
{
    for_points([&](const Vector& z) {
        Vector p = z;
        set_.project(p, p);
        EXPECT_EQ(p, projected(z));
    });
}

TEST_P(ConvexSetSuite, AnotherUnitOfLengthChangesNoBit)
{
    for (const double unit : {0x1p-600, 0x1p-30, 0x1p30, 0x1p600}) {
        const AnySet other = GetParam().make(unit);
        for_points(
            [&](const Vector& z) {
                Vector scaled = z, p = projected(z);
                for (double& x : scaled) x *= unit;
                for (double& x : p) x *= unit;
                Vector d(z.size() * z.size());
                other.derivative(scaled, d);
                EXPECT_EQ(d, derivative(z)) << unit;
                other.project(scaled, scaled);
                EXPECT_EQ(scaled, p) << unit;
            },
            200);
    }
}

TEST_P(ConvexSetSuite, NotANumberIsNotProjectedToANumber)
{
    for_points(
        [&](const Vector& z) {
            for (std::size_t i = 0; i < z.size(); ++i) {
                Vector hole = z;
                hole[i] = std::numeric_limits<double>::quiet_NaN();
                const Vector p = projected(hole);
                EXPECT_TRUE(std::any_of(p.begin(), p.end(), [](double x) { return std::isnan(x); }))
                    << "component " << i << " of " << testing::PrintToString(z);
            }
        },
        50);
}

TEST_P(ConvexSetSuite, ABoxIsWhatItsBoundsSay)
{
    for (std::size_t i = 0; i < set_.box.size(); ++i) {
        Vector far = projected(Vector(dimension(), 1e300));
        EXPECT_EQ(far[i], std::min(set_.box[i][1], 1e300));
        far = projected(Vector(dimension(), -1e300));
        EXPECT_EQ(far[i], std::max(set_.box[i][0], -1e300));
    }
}

TEST_P(ConvexSetSuite, PassesTheCheckOfUsersSetsAndHasNoFault)
{
    EXPECT_NO_THROW(set_.check());
    EXPECT_EQ(set_.fault, "");
}

}  // namespace ricochet::test
