// Applies the common suite to every convex set.
#include "conformance/convex_sets.hpp"

#include <algorithm>

namespace ricochet::test::convex_sets_conformance_test {
namespace {

using namespace sets;

constexpr double inf = std::numeric_limits<double>::infinity();

/// Violation of [lower, upper].
double interval_violation(double x, double lower, double upper)
{
    return std::max(lower - x, x - upper);
}

/// sup of n x over it.
double interval_support(double n, double lower, double upper)
{
    return n > 0 ? n * upper : n < 0 ? n * lower : 0;
}

double norm(const Vector& x, std::size_t first)
{
    return length(Vector(x.begin() + static_cast<std::ptrdiff_t>(first), x.end()));
}

/// Coulomb's cone. Its polar is n0 <= -friction |n_t|.
double cone_violation(const Vector& x, double friction)
{
    return std::max(norm(x, 1) - friction * x[0], -x[0]);
}

double cone_support(const Vector& n, double friction)
{
    return n[0] + friction * norm(n, 1) <= 1e-12 * length(n) ? 0 : inf;
}

Vector part(const Vector& x, std::size_t first, std::size_t count)
{
    const auto begin = x.begin() + static_cast<std::ptrdiff_t>(first);
    return {begin, begin + static_cast<std::ptrdiff_t>(count)};
}

SetCase interval(const std::string& name, double lower, double upper)
{
    std::vector<Vector> kinks;
    for (const double bound : {lower, upper}) {
        if (std::isfinite(bound)) kinks.push_back({bound});
    }
    return {name, [=](double unit) { return any_set(IntervalSet(lower * unit, upper * unit)); },
            [=](const Vector& x) { return interval_violation(x[0], lower, upper); },
            [=](const Vector& n) { return interval_support(n[0], lower, upper); }, kinks};
}

template <std::size_t N>
SetCase ball(const std::string& name, double radius, const Vector& on_its_edge)
{
    return {name,
            [=](double unit) { return any_set(Ball<N>(radius * unit)); },
            [=](const Vector& x) { return length(x) - radius; },
            [=](const Vector& n) { return radius * length(n); },
            {on_its_edge, Vector(N, 0.0)}};
}

template <std::size_t N>
SetCase cone(const std::string& name, double friction)
{
    Vector polar(N, 0.0);
    polar[0] = -friction, polar[1] = 1;
    Vector edge(N, 0.0);
    edge[0] = 1, edge[1] = friction;
    return {name,
            [=](double /*unit*/) { return any_set(FrictionCone<N>(friction)); },
            [=](const Vector& x) { return cone_violation(x, friction); },
            [=](const Vector& n) { return cone_support(n, friction); },
            {Vector(N, 0.0), polar, edge}};
}

std::vector<SetCase> all()
{
    return {
        interval("Interval", -0.5, 2),
        interval("Relay", -1, 1),
        interval("HalfLine", 0, inf),
        interval("Line", -inf, inf),
        {"Box",
         [](double u) {
             return any_set(Box<3>({-u, 0, 0.5 * u}, {u, inf, 32 * u}));
         },
         [](const Vector& x) {
             return std::max({interval_violation(x[0], -1, 1), interval_violation(x[1], 0, inf),
                              interval_violation(x[2], 0.5, 32)});
         },
         [](const Vector& n) {
             return interval_support(n[0], -1, 1) + interval_support(n[1], 0, inf) +
                    interval_support(n[2], 0.5, 32);
         },
         {{1, 0, 0.5}, {-1, 3, 32}}},
        {"Orthant",
         [](double) { return any_set(Orthant<4>()); },
         [](const Vector& x) { return -*std::min_element(x.begin(), x.end()); },
         [](const Vector& n) {
             double sum = 0;
             for (const double component : n) sum += interval_support(component, 0, inf);
             return sum;
         },
         {{0, 0, 0, 0}, {0, 1, -1, 0}}},
        ball<1>("BallOfOne", 1.5, {-1.5}),
        ball<2>("Disk", 2, {1.2, -1.6}),
        ball<3>("Ball", 0.7, {0.7, 0, 0}),
        cone<2>("ConeOfTwo", 0.3),
        cone<3>("Cone", 0.5),
        cone<3>("WideCone", 2),
        cone<4>("ConeOfFour", 1),
        {"Product",
         [](double u) {
             return any_set(Product(Ball<2>(u), FrictionCone<3>(0.5), IntervalSet(-u, u)));
         },
         [](const Vector& x) {
             return std::max({length(part(x, 0, 2)) - 1, cone_violation(part(x, 2, 3), 0.5),
                              interval_violation(x[5], -1, 1)});
         },
         [](const Vector& n) {
             // The rounding in the cone's part is measured relative to the whole.
             const Vector in_cone = part(n, 2, 3);
             const bool cancelled = length(in_cone) <= 1e-12 * length(n);
             return length(part(n, 0, 2)) + (cancelled ? 0 : cone_support(in_cone, 0.5)) +
                    interval_support(n[5], -1, 1);
         },
         {{1, 0, 0, 0, 0, 1}, {0, 0, 1, 0.5, 0, -1}}},
        {"ProductOfIntervals",
         [](double u) { return any_set(Product(IntervalSet(0, u), IntervalSet(-2 * u, 3 * u))); },
         [](const Vector& x) {
             return std::max(interval_violation(x[0], 0, 1), interval_violation(x[1], -2, 3));
         },
         [](const Vector& n) {
             return interval_support(n[0], 0, 1) + interval_support(n[1], -2, 3);
         },
         {{0, 3}, {1, -2}}}};
}

INSTANTIATE_TEST_SUITE_P(All, ConvexSetSuite, testing::ValuesIn(all()),
                         [](const auto& info) { return info.param.name; });

// Sets without an interior, which have few points.

/// The nearest point to z of a set that is a point, or a half line along the first axis.
template <class Set>
void expect_degenerate(const Set& set, bool half_line)
{
    const AnySet any = any_set(set);
    EXPECT_NO_THROW(any.check());
    for (const double first : {-2.0, 0.0, 3.0}) {
        Vector z(any.dimension, 1.5);
        z[0] = first;
        Vector p(any.dimension), expected(any.dimension, 0.0);
        any.project(z, p);
        if (half_line) expected[0] = std::max(first, 0.0);
        EXPECT_EQ(p, expected);
    }
}

TEST(ConvexSets, WithoutAnInteriorAreProjectedOnAsWell)
{
    expect_degenerate(IntervalSet::symmetric(0), false);
    expect_degenerate(Ball<3>(0), false);
    expect_degenerate(Box<2>({0, 0}, {0, 0}), false);
    expect_degenerate(FrictionCone<3>(0), true);
}

TEST(ConvexSets, WhatIsNoSetSaysWhy)
{
    const double nan = std::nan("");
    const auto expect = [](const auto& set, std::string_view why) {
        EXPECT_NE(set.fault().find(why), std::string_view::npos) << set.fault();
    };
    expect(IntervalSet(1, -1), "empty");
    expect(IntervalSet::symmetric(-0.1), "empty");
    expect(IntervalSet(nan, 1), "not a number");
    expect(Box<2>({-1, 1}, {1, -1}), "empty");
    expect(Box<2>({-1, -1}, {1, nan}), "not a number");
    expect(Ball<2>(-1), "negative");
    expect(Ball<2>(nan), "not a number");
    expect(FrictionCone<2>(-1), "negative");
    expect(FrictionCone<2>(nan), "not a number");
    expect(Product(IntervalSet(0, 1), Ball<2>(-1)), "negative");
    expect(Product(IntervalSet(1, 0), Ball<2>(1)), "empty");
}

}  // namespace
}  // namespace ricochet::test::convex_sets_conformance_test
