#include "ricochet/detail/features.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "ricochet/base/random.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::features_test {
namespace {

using detail::dimension;
using detail::features;
using detail::offers;
using detail::Recipe;
using detail::recipe_named;
using detail::slog;

using State = std::array<double, 2>;

/// A guard without a declared curvature, or anything else.
struct Ramp {
    static constexpr bool resets = false;
    void flow(double, const State&, State& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
};

State ballistic(double gravity, const State& x, double h)
{
    State out{};
    features(Recipe::ballistic, BouncingBall({.gravity = gravity}), x, h, out.data());
    return out;
}

TEST(Features, RecipesAreFoundByTheirNames)
{
    EXPECT_EQ(recipe_named("state"), Recipe::state);
    EXPECT_EQ(recipe_named("ballistic"), Recipe::ballistic);
    EXPECT_EQ(dimension(Recipe::state, 5), 5U);
    EXPECT_EQ(dimension(Recipe::ballistic, 5), 2U);
    try {
        (void)recipe_named("polar");
        FAIL() << "an unknown recipe was accepted";
    } catch (const std::invalid_argument& error) {
        const std::string what = error.what();
        EXPECT_NE(what.find("polar"), std::string::npos);
        EXPECT_NE(what.find("state, ballistic"), std::string::npos);
    }
}

TEST(Features, StateIsTheStateItself)
{
    const std::vector<double> x{3, -1};
    std::array<double, 2> out{};
    features(Recipe::state, BouncingBall{}, x, 0.01, out.data());
    EXPECT_EQ(out, (std::array<double, 2>{3, -1}));
}

TEST(Features, BallisticRatiosAreOfHeightAndSpeedToWhatGravityDoesInAStep)
{
    // u / (g h^2) = 3 / (10 * 0.04) = 7.5, where 1 + 2 * 7.5 = 2^4;
    // v / (g h) = -5 / 2 = -2.5, where 1 + 2 * 2.5 = 2^2 * 1.5.
    const State out = ballistic(10, {3, -5}, 0.2);
    EXPECT_NEAR(out[0], 4, 1e-14);
    EXPECT_NEAR(out[1], -2.5, 1e-14);
}

TEST(Features, BallisticIsTheSameForEveryGravityAndStep)
{
    // Only the rounding of the ratios differs: a few ulp, and the same of slog.
    learn::Random random(1);
    for (int i = 0; i < 1000; ++i) {
        const double a = random.log_uniform(1e-6, 1e14);
        const double b = -random.log_uniform(1e-6, 1e14);
        const double g = random.log_uniform(0.1, 100);
        const double h = random.log_uniform(1e-6, 1e2);
        const State out = ballistic(g, {a * g * h * h, b * g * h}, h);
        EXPECT_NEAR(out[0], slog(a), 1e-13 * (1 + out[0]));
        EXPECT_NEAR(out[1], slog(b), 1e-13 * (1 - out[1]));
    }
}

TEST(Features, SignedLogarithmIsOddMonotoneAndNearTheSmoothOne)
{
    // e + m - 1 is below e + log2(m) by at most 0.0861, where m = 1 / log(2).
    double before = -1;
    for (double a = 1e-18; a < 1e300; a *= 1.0037) {
        const double value = slog(a);
        const double smooth = std::log1p(2 * a) / std::log(2);
        EXPECT_LE(value, smooth * (1 + 1e-15) + 1e-15);
        EXPECT_GE(value, smooth - 0.0861);
        EXPECT_EQ(slog(-a), -value);
        EXPECT_GE(value, before);
        before = value;
    }
    EXPECT_EQ(slog(0), 0);
    EXPECT_EQ(slog(0.5), 1);
    EXPECT_NEAR(slog(1e-3), 2e-3, 1e-15);  // linear here; a grid of 2^-52
    const double infinity = std::numeric_limits<double>::infinity();
    EXPECT_LE(slog(infinity), 1024);
    EXPECT_TRUE(std::isnan(slog(std::numeric_limits<double>::quiet_NaN())));
}

TEST(Features, BallisticIsFiniteForEveryFiniteInput)
{
    constexpr double tiny = std::numeric_limits<double>::denorm_min();
    constexpr double huge = std::numeric_limits<double>::max();
    const std::array<double, 9> values{0, tiny, 1e-300, 1e-20, 1, 9.81, 1e20, 1e300, huge};
    for (const double u : values) {
        for (const double v : values) {
            for (const double gravity : values) {
                for (const double h : values) {
                    if (gravity == 0 || h == 0) continue;
                    const State up = ballistic(gravity, {u, v}, h);
                    const State down = ballistic(gravity, {-u, -v}, h);
                    for (const std::size_t i : {0U, 1U}) {
                        ASSERT_TRUE(std::isfinite(up[i]))
                            << u << ' ' << v << ' ' << gravity << ' ' << h;
                        ASSERT_LE(std::abs(up[i]), 1024);
                        ASSERT_EQ(up[i], -down[i]);
                    }
                }
            }
        }
    }
}

TEST(Features, NotANumberStaysNotANumber)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(std::isnan(ballistic(9.81, {nan, 1}, 0.01)[0]));
    EXPECT_TRUE(std::isnan(ballistic(9.81, {1, nan}, 0.01)[1]));
}

TEST(Features, SystemWithoutCurvatureOffersTheStateOnly)
{
    EXPECT_TRUE((offers<Ramp, State>(Recipe::state)));
    EXPECT_FALSE((offers<Ramp, State>(Recipe::ballistic)));
    EXPECT_TRUE((offers<BouncingBall, State>(Recipe::ballistic)));
    State out{};
    features(Recipe::ballistic, Ramp{}, State{1, 2}, 0.1, out.data());
    EXPECT_TRUE(std::isnan(out[0]));
    EXPECT_TRUE(std::isnan(out[1]));
}

}  // namespace
}  // namespace ricochet::features_test
