#include "ricochet/learn/surface.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace ricochet::learn::surface_test {
namespace {

constexpr double gravity = 9.81;

using State = std::array<double, 2>;  // height [m], velocity [m/s]

State fall(const State& x, double h)
{
    return {x[0] + h * (x[1] - 0.5 * gravity * h), x[1] - gravity * h};
}

/// The floor under a ball, with the state as its own features.
struct Floor {
    using State = surface_test::State;

    [[nodiscard]] State surface(Random& random) const { return {0, -random.log_uniform(0.01, 15)}; }
    [[nodiscard]] double guard(const State& x) const { return x[0]; }
    [[nodiscard]] double horizon(const State& x) const { return -2 * x[1] / gravity; }
    [[nodiscard]] double magnitude(const State& x, double h) const
    {
        return std::abs(x[0]) + h * std::abs(x[1]) + 0.5 * gravity * h * h;
    }
    [[nodiscard]] bool inside(const State& x) const { return x[0] > -1; }
    [[nodiscard]] std::vector<Column> columns() const { return {{"u", "m"}, {"v", "m/s"}}; }
    void features(const State& x, double* out) const
    {
        out[0] = x[0];
        out[1] = x[1];
    }
};
static_assert(SurfaceProblem<Floor>);

/// x' = -1 towards a surface at 0; backward nothing limits the motion.
struct Wall {
    using State = double;

    [[nodiscard]] double surface(Random&) const { return 0; }
    [[nodiscard]] double guard(double x) const { return x; }
    [[nodiscard]] double horizon(double) const { return std::numeric_limits<double>::infinity(); }
    [[nodiscard]] double magnitude(double x, double h) const { return std::abs(x) + h; }
    [[nodiscard]] bool inside(double) const { return true; }
    [[nodiscard]] std::vector<Column> columns() const { return {{"x", "m"}}; }
    void features(double x, double* out) const { *out = x; }
};

TEST(Surface, LabelsAreThoseOfTheExactBoundary)
{
    const double h = 0.01;
    const SurfaceSample sample = sample_surface(
        Floor{}, fall, {.step = h, .events = 5000, .clear = 5000, .keep_band = true});
    ASSERT_EQ(sample.data.size(), 10'000U);
    EXPECT_EQ(sample.data.events(), 5000U);
    for (std::size_t i = 0; i < sample.data.size(); ++i) {
        const auto x = sample.data.row(i);
        const double end = x[0] + x[1] * h - gravity * h * h / 2;
        // Where rounding decides the label, either label is accepted.
        if (std::abs(end) < 1e-15) continue;
        EXPECT_EQ(sample.data.labels[i] != 0, end <= 0) << x[0] << ' ' << x[1];
    }
}

TEST(Surface, EventsReallyCrossWithinTheStep)
{
    // States above the floor must come down to it at a time in (0, h]: the larger
    // root of u + v t - g t^2 / 2, with the rounding of a state of order one.
    const double h = 0.01;
    const SurfaceSample sample =
        sample_surface(Floor{}, fall, {.step = h, .events = 5000, .clear = 100, .beyond_share = 0});
    for (std::size_t i = 0; i < sample.data.size(); ++i) {
        if (sample.data.labels[i] == 0) continue;
        const auto x = sample.data.row(i);
        ASSERT_GE(x[0], -1e-15);
        const double t =
            (x[1] + std::sqrt(x[1] * x[1] + 2 * gravity * std::max(x[0], 0.0))) / gravity;
        EXPECT_GE(t, 0);
        EXPECT_LE(t, h * (1 + 1e-10));
    }
}

TEST(Surface, ClearStatesKeepTheMarginUnlessTheBandIsAskedFor)
{
    const SurfaceOptions options{.step = 0.01, .events = 2000, .clear = 2000, .margin = 0.1};
    const SurfaceSample sample = sample_surface(Floor{}, fall, options);
    EXPECT_GT(sample.band, 0U);
    for (std::size_t i = 0; i < sample.data.size(); ++i) {
        const double margin = sample.data.margins[i];
        if (sample.data.labels[i] == 0) {
            EXPECT_GE(margin, 0.1);
        } else {
            EXPECT_LE(margin, 0);
        }
        EXPECT_LE(std::abs(margin), 1 + 1e-12);
    }
    SurfaceOptions with_band = options;
    with_band.keep_band = true;
    std::size_t in_band = 0;
    for (const double margin : sample_surface(Floor{}, fall, with_band).data.margins) {
        in_band += margin > 0 && margin < 0.1 ? 1 : 0;
    }
    EXPECT_GT(in_band, 100U);
}

TEST(Surface, ReachesBothSidesOfTheSurfaceAndBothDirectionsOfMotion)
{
    const SurfaceSample sample =
        sample_surface(Floor{}, fall, {.step = 0.01, .events = 2000, .clear = 2000});
    std::array<std::size_t, 4> quadrants{};
    for (std::size_t i = 0; i < sample.data.size(); ++i) {
        const auto x = sample.data.row(i);
        ++quadrants[(x[0] < 0 ? 2U : 0U) + (x[1] < 0 ? 1U : 0U)];
    }
    for (const std::size_t count : quadrants) EXPECT_GT(count, 20U);
}

TEST(Surface, SameSeedGivesTheSameBits)
{
    const SurfaceOptions options{.events = 500, .clear = 500, .seed = 3};
    EXPECT_EQ(sample_surface(Floor{}, fall, options).data.features,
              sample_surface(Floor{}, fall, options).data.features);
    SurfaceOptions other = options;
    other.seed = 4;
    EXPECT_NE(sample_surface(Floor{}, fall, options).data.features,
              sample_surface(Floor{}, fall, other).data.features);
}

TEST(Surface, TakesAnyOneStepMapAndAnEndlessWayBack)
{
    const auto approach = [](double x, double h) { return x - h; };
    const SurfaceSample sample =
        sample_surface(Wall{}, approach, {.step = 0.5, .events = 200, .clear = 200, .longest = 10});
    for (std::size_t i = 0; i < sample.data.size(); ++i) {
        EXPECT_EQ(sample.data.labels[i] != 0, sample.data.features[i] <= 0.5);
    }
}

TEST(Surface, RefusesWhatCannotBeSampled)
{
    EXPECT_THROW((void)sample_surface(Floor{}, fall, {.step = 0}), std::invalid_argument);
    EXPECT_THROW((void)sample_surface(Floor{}, fall, {.step = -0.1}), std::invalid_argument);
    EXPECT_THROW((void)sample_surface(Floor{}, fall, {.margin = 1}), std::invalid_argument);
    // Nothing ever comes nearer, so there are no clear states.
    const auto stand = [](double x, double) { return x; };
    EXPECT_THROW((void)sample_surface(Wall{}, stand, {.events = 1, .clear = 1}),
                 std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::learn::surface_test
