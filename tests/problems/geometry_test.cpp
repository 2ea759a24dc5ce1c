// Trees against an exhaustive check.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "problems/geometry/concave_table.hpp"
#include "problems/geometry/distance_grid.hpp"
#include "problems/geometry/outline.hpp"
#include "problems/geometry/segments.hpp"
#include "ricochet/base/random.hpp"
#include "scene_bounds.hpp"

namespace ricochet::geometry::geometry_test {
namespace {

using learn::Random;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

Point2 random_point(Random& random, double size)
{
    return {random.uniform(-size, size), random.uniform(-size, size)};
}

std::vector<Segment2> random_segments(std::size_t n, double length, Random& random)
{
    std::vector<Segment2> out;
    for (std::size_t i = 0; i < n; ++i) {
        const Point2 a = random_point(random, 1);
        out.push_back({a, a + length * random_point(random, 1)});
    }
    return out;
}

/// The distance by another formula, in long double.
double plain_distance(const Segment2& s, Point2 p)
{
    const long double dx = static_cast<long double>(s.b.x) - s.a.x;
    const long double dy = static_cast<long double>(s.b.y) - s.a.y;
    const long double wx = static_cast<long double>(p.x) - s.a.x;
    const long double wy = static_cast<long double>(p.y) - s.a.y;
    const long double length = std::hypot(dx, dy);
    const long double along = (wx * dx + wy * dy) / length;
    if (along <= 0) return static_cast<double>(std::hypot(wx, wy));
    if (along >= length) return static_cast<double>(std::hypot(wx - dx, wy - dy));
    return static_cast<double>(std::fabs(wx * dy - wy * dx) / length);
}

double plain_distance(const std::vector<Segment2>& segments, Point2 p)
{
    double least = infinity;
    for (const Segment2& s : segments) least = std::min(least, plain_distance(s, p));
    return least;
}

void expect_same(const NearestOnSegment& a, const NearestOnSegment& b)
{
    EXPECT_EQ(a.distance, b.distance);
    EXPECT_EQ(a.segment, b.segment);
    EXPECT_EQ(a.along, b.along);
    EXPECT_EQ(a.point.x, b.point.x);
    EXPECT_EQ(a.point.y, b.point.y);
}

TEST(Segments, TheTreeFindsWhatALookAtAllOfThemFinds)
{
    Random random(1);
    // Counts around the sizes of blocks and nodes; short and long segments; any hint.
    for (const std::size_t n : {1U, 2U, 4U, 5U, 16U, 17U, 64U, 65U, 255U, 1000U}) {
        for (const double length : {1e-3, 0.1, 2.0}) {
            const std::vector<Segment2> given = random_segments(n, length, random);
            const Segments segments(given);
            for (int i = 0; i < 200; ++i) {
                const Point2 p = random_point(random, i % 10 == 0 ? 1000 : 1.5);
                const NearestOnSegment brute = segments.nearest_brute(p);
                expect_same(segments.nearest(p, static_cast<std::uint32_t>(random.below(n + 1))),
                            brute);
                // Some ten roundings of numbers of the size of the coordinates.
                EXPECT_NEAR(brute.distance, plain_distance(given, p), 1e-12);
            }
        }
    }
}

TEST(Segments, OnEndsAndOnSegmentsTheDistanceIsZeroAndTheFirstOfThemIsNamed)
{
    Random random(2);
    std::vector<Point2> ring;
    for (int i = 0; i < 500; ++i) ring.push_back(random_point(random, 3));
    std::vector<Segment2> given;
    for (std::size_t i = 0; i < ring.size(); ++i) {
        given.push_back({ring[i], ring[(i + 1) % ring.size()]});
    }
    const Segments segments(given);
    for (std::size_t i = 0; i < given.size(); ++i) {
        const NearestOnSegment at_end = segments.nearest(given[i].a, 17);
        expect_same(at_end, segments.nearest_brute(given[i].a));
        EXPECT_EQ(at_end.distance, 0);
        const Point2 middle = 0.5 * (given[i].a + given[i].b);
        expect_same(segments.nearest(middle, 17), segments.nearest_brute(middle));
        EXPECT_LT(segments.nearest(middle).distance, 1e-14);
    }
}

TEST(Segments, SeveralAtTheSameDistanceAreToldApartByTheirNumber)
{
    // A regular ring seen from its centre, each segment given twice.
    std::vector<Segment2> given;
    for (int i = 0; i < 200; ++i) {
        const double x = i % 2 == 0 ? 1 : -1;
        given.push_back({{x, -1}, {x, 1}});
    }
    const Segments segments(given);
    for (std::uint32_t hint = 0; hint < 200; ++hint) {
        EXPECT_EQ(segments.nearest({0, 0.5}, hint).segment, 0U);
        EXPECT_EQ(segments.nearest({-2, 0}, hint).segment, 1U);
    }
    EXPECT_EQ(segments.nearest_brute({0, 0.5}).segment, 0U);
}

TEST(Segments, WhatIsNoNumberHasNoDistance)
{
    Random random(3);
    const Segments segments(random_segments(100, 0.1, random));
    for (const Point2 p : {Point2{nan, 0}, Point2{0, nan}, Point2{nan, infinity}}) {
        EXPECT_TRUE(std::isnan(segments.nearest(p, 5).distance));
        EXPECT_TRUE(std::isnan(segments.nearest_brute(p).distance));
    }
    for (const Point2 p : {Point2{1e200, 0}, Point2{0, -infinity}}) {
        EXPECT_EQ(segments.nearest(p, 5).distance, infinity);
        EXPECT_EQ(segments.nearest_brute(p).distance, infinity);
    }
    EXPECT_TRUE(std::isnan(segments.nearest(Segment2{{nan, 0}, {1, 1}}, infinity).distance));
}

TEST(Segments, FarAwayTheTreeStillFindsTheSame)
{
    Random random(4);
    const Segments segments(random_segments(300, 0.01, random));
    for (int i = 0; i < 500; ++i) {
        const Point2 p = random_point(random, std::pow(10.0, random.uniform(0, 140)));
        expect_same(segments.nearest(p, 7), segments.nearest_brute(p));
    }
}

TEST(Segments, PairsOfSegmentsAreTheSameFromTheTreeAndNoFurtherThanAnyTwoPoints)
{
    Random random(5);
    for (const std::size_t n : {1U, 7U, 64U, 320U}) {
        const std::vector<Segment2> given = random_segments(n, 0.1, random);
        const Segments segments(given);
        for (int i = 0; i < 300; ++i) {
            const Point2 a = random_point(random, 1.5);
            const Segment2 s{a, a + random_point(random, 0.5)};
            const NearestPair brute = segments.nearest_brute(s, infinity);
            const NearestPair tree =
                segments.nearest(s, infinity, static_cast<std::uint32_t>(random.below(n)));
            EXPECT_EQ(tree.distance, brute.distance);
            EXPECT_EQ(tree.segment, brute.segment);
            const Point2 gap = tree.point - tree.other;
            EXPECT_NEAR(std::hypot(gap.x, gap.y), tree.distance, 1e-14);
            double least = infinity;  // over points of s; a grid of 101 has an error of 0.007 / 2
            for (int k = 0; k <= 100; ++k) {
                const Point2 p = s.a + (k / 100.0) * (s.b - s.a);
                least = std::min(least, segments.nearest_brute(p).distance);
            }
            EXPECT_LE(brute.distance, least + 1e-14);
            EXPECT_GE(brute.distance, least - 0.0036);
            // A limit below the answer is returned as it is.
            EXPECT_EQ(segments.nearest(s, brute.distance / 2).distance, brute.distance / 2);
        }
    }
}

TEST(Segments, SegmentsThatCrossAreAtDistanceZeroAtTheirCommonPoint)
{
    const NearestPair pair = nearest_points({{-1, 0}, {3, 0}}, {{0, -2}, {0, 2}});
    EXPECT_EQ(pair.distance, 0);
    EXPECT_NEAR(pair.point.x, 0, 1e-15);
    EXPECT_NEAR(pair.point.y, 0, 1e-15);
    EXPECT_EQ(nearest_points({{0, 0}, {1, 0}}, {{1, 0}, {1, 1}}).distance, 0);
    EXPECT_EQ(nearest_points({{0, 0}, {1, 0}}, {{0, 2}, {1, 2}}).distance, 2);
}

TEST(Segments, BadOnesAreRefusedByNumber)
{
    EXPECT_EQ(refusal([] { Segments(std::vector<Segment2>{}); }), "Segments: there is none");
    EXPECT_NE(refusal([] {
                  Segments({{{0, 0}, {1, 0}}, {{1, 0}, {nan, 0}}});
              }).find("segment 1"),
              std::string::npos);
    EXPECT_NE(refusal([] {
                  Segments({{{0, 0}, {1, 0}}, {{1, 0}, {1, 0}}});
              }).find("segment 1"),
              std::string::npos);
    EXPECT_NE(refusal([] {
                  Segments(std::vector<Segment2>{{{0, 0}, {1e300, 0}}});
              }).find("segment 0"),
              std::string::npos);
}

/// Whether p is inside, by the number of edges to its right.
bool inside(const std::vector<Point2>& vertices, Point2 p)
{
    bool odd = false;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const Point2 a = vertices[i];
        const Point2 b = vertices[(i + 1) % vertices.size()];
        if ((a.y > p.y) == (b.y > p.y)) continue;
        if (p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)) odd = !odd;
    }
    return odd;
}

std::vector<Point2> star(std::size_t n, Random& random, bool clockwise)
{
    std::vector<Point2> out;
    for (std::size_t i = 0; i < n; ++i) {
        const double angle = (clockwise ? -2 : 2) * std::numbers::pi * static_cast<double>(i) /
                             static_cast<double>(n);
        const double distance = random.uniform(0.5, 1.5);
        out.push_back({distance * std::cos(angle), distance * std::sin(angle)});
    }
    return out;
}

TEST(Outline, TheSignTellsInsideFromOutsideAlsoNearSharpCorners)
{
    Random random(6);
    for (const std::size_t n : {3U, 8U, 50U, 400U}) {
        for (const bool clockwise : {false, true}) {
            const std::vector<Point2> vertices = star(n, random, clockwise);
            const Outline outline(vertices);
            for (int i = 0; i < 2000; ++i) {
                // Half of the points lie close to a vertex.
                const Point2 p = i % 2 == 0
                                     ? random_point(random, 2)
                                     : vertices[random.below(n)] + random_point(random, 0.01);
                const NearestOnSegment found = outline.edges().nearest(p);
                const double distance = outline.signed_distance(p, found);
                EXPECT_EQ(std::fabs(distance), found.distance);
                if (found.distance <= 1e-12) continue;
                EXPECT_EQ(distance > 0, inside(vertices, p));
            }
        }
    }
}

TEST(Outline, OpenEmptyAndUndefinedPolygonsAreRefusedByElement)
{
    const std::vector<Segment2> open{{{0, 0}, {1, 0}}, {{1, 0}, {1, 1}}, {{1, 2}, {0, 0}}};
    const std::string sentence = refusal([&] { (void)Outline::from_segments(open); });
    EXPECT_NE(sentence.find("open; segment 2 starts at (1, 2)"), std::string::npos) << sentence;
    EXPECT_NE(refusal([] { (void)Outline::from_segments({}); }).find("got 0"), std::string::npos);
    EXPECT_NE(refusal([] { Outline({{0, 0}, {1, 0}}); }).find("got 2"), std::string::npos);
    EXPECT_NE(refusal([] {
                  Outline({{0, 0}, {1, nan}, {0, 1}});
              }).find("vertex 1"),
              std::string::npos);
    EXPECT_NE(refusal([] {
                  Outline({{0, 0}, {1, 0}, {1, 0}, {0, 1}});
              }).find("vertex 2"),
              std::string::npos);
    EXPECT_NE(refusal([] { Outline({{0, 0}, {1, 0}, {2, 0}}); }).find("area"), std::string::npos);
    const std::vector<Segment2> closed{{{0, 0}, {1, 0}}, {{1, 0}, {1, 1}}, {{1, 1}, {0, 0}}};
    EXPECT_EQ(Outline::from_segments(closed).edges().size(), 3U);
}

TEST(DistanceGrid, IsBelowTheDistanceByNoMoreThanTwiceTheWayToTheCentre)
{
    Random random(7);
    const Outline outline(star(300, random, false));
    const auto distance = [&](const std::array<double, 2>& p) {
        return outline.signed_distance({p[0], p[1]}, outline.edges().nearest({p[0], p[1]}));
    };
    Box<2> box;
    box.add(std::array{-1.6, -1.7});
    box.add(std::array{1.8, 1.5});
    const DistanceGrid<2> grid(box, 40, 0, distance);
    EXPECT_EQ(grid.size(), 1600U);
    const double half_diagonal = std::hypot(3.4, 3.2) / 80;
    for (int i = 0; i < 20'000; ++i) {
        const std::array<double, 2> p{random.uniform(-1.6, 1.8), random.uniform(-1.7, 1.5)};
        EXPECT_LE(grid.lower_bound(p), distance(p) + 1e-15);
        EXPECT_GE(grid.lower_bound(p), distance(p) - 2 * half_diagonal - 1e-6);
        EXPECT_LE(grid.lower_bound_of_cell(p), grid.lower_bound(p) + 1e-15);
        EXPECT_GE(grid.lower_bound_of_cell(p), distance(p) - 2 * half_diagonal - 1e-6);
    }
    for (const auto& p : {std::array{-1.7, 0.0}, std::array{0.0, 1.6}, std::array{nan, 0.0}}) {
        EXPECT_EQ(grid.lower_bound(p), -infinity);
        EXPECT_EQ(grid.lower_bound_of_cell(p), -infinity);
    }
    EXPECT_NE(refusal([&] { DistanceGrid<2>(box, 0, 0, distance); }), "accepted");
    EXPECT_NE(refusal([&] { DistanceGrid<2>(Box<2>{}, 3, 0, distance); }), "accepted");
}

/// The least of a few planes and a smooth bowl, upside down.
Tangent<3> dome(const std::array<double, 3>& p)
{
    const auto [x, y, z] = p;
    const Tangent<3> bowl{1 - x * x - 0.5 * y * y + x * z - z * z, {-2 * x + z, -y, x - 2 * z}};
    const Tangent<3> plane{0.5 + 0.7 * x - 0.3 * y + 0.2 * z, {0.7, -0.3, 0.2}};
    return bowl.value < plane.value ? bowl : plane;
}

TEST(ConcaveTable, BoundsAConcaveFunctionFromBothSides)
{
    Box<3> box;
    box.add(std::array{-1.0, -2.0, 0.5});
    box.add(std::array{1.0, 1.0, 2.0});
    Random random(17);
    std::array<double, 2> worst{};
    for (const std::size_t cells : {4U, 16U}) {
        const ConcaveTable<3> table(box, cells, 0, dome);
        EXPECT_EQ(table.size(), (cells + 1) * (cells + 1) * (cells + 1));
        double& widest = worst[cells == 4 ? 0 : 1];
        for (int i = 0; i < 20'000; ++i) {
            const std::array<double, 3> p{random.uniform(-1, 1), random.uniform(-2, 1),
                                          random.uniform(0.5, 2)};
            const double f = dome(p).value;
            ASSERT_LE(table.lower_bound(p), f);
            ASSERT_GE(table.upper_bound(p), f);
            widest = std::max(widest, table.upper_bound(p) - table.lower_bound(p));
        }
    }
    // Second order on the bowl, first order only in cells crossed by the edge.
    EXPECT_LT(worst[1], worst[0] / 3);
    EXPECT_LT(worst[1], 0.1);
}

TEST(ConcaveTable, SaysNothingOutsideAndRefusesWhatIsNoTable)
{
    Box<3> box;
    box.add(std::array{-1.0, -1.0, -1.0});
    box.add(std::array{1.0, 1.0, 1.0});
    const ConcaveTable<3> table(box, 3, 0, dome);
    for (const auto& p :
         {std::array{1.5, 0.0, 0.0}, std::array{0.0, 0.0, -1.01}, std::array{0.0, nan, 0.0}}) {
        EXPECT_EQ(table.lower_bound(p), -infinity);
        EXPECT_EQ(table.upper_bound(p), infinity);
    }
    EXPECT_EQ(ConcaveTable<3>().lower_bound({0, 0, 0}), -infinity);
    // A larger error of the values makes both bounds wider by that much.
    const ConcaveTable<3> rough(box, 3, 0.25, dome);
    const std::array<double, 3> p{0.3, -0.2, 0.4};
    EXPECT_NEAR(table.lower_bound(p) - rough.lower_bound(p), 0.25, 1e-12);
    EXPECT_NEAR(rough.upper_bound(p) - table.upper_bound(p), 0.25, 1e-12);
    EXPECT_NE(refusal([&] { ConcaveTable<3>(box, 0, 0, dome); }), "accepted");
    EXPECT_NE(refusal([&] { ConcaveTable<3>(box, 300, 0, dome); }).find("2^24"), std::string::npos);
    EXPECT_NE(refusal([&] { ConcaveTable<3>(Box<3>{}, 3, 0, dome); }), "accepted");
    const auto broken = [](const std::array<double, 3>& at) {
        return at[0] > 0 ? Tangent<3>{.value = nan} : dome(at);
    };
    EXPECT_NE(refusal([&] { ConcaveTable<3>(box, 3, 0, broken); }).find("node 2"),
              std::string::npos);
}

}  // namespace
}  // namespace ricochet::geometry::geometry_test
