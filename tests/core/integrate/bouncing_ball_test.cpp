#include "ricochet/systems/bouncing_ball.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace ricochet::bouncing_ball_test {
namespace {

// t_0 = sqrt(2 h / g), t_{n+1} = t_n + 2 t_0 r^{n+1}, in 34 digits, rounded.
constexpr std::array<double, 13> paper_impacts = {
    1.427843122927064467,  3.997960744195780508,  6.311066603337624944,  8.392861876565284937,
    10.266477622470178930, 11.952731793784583525, 13.470360547967547659, 14.836226426732215381,
    16.065505717620416330, 17.171857079419797184, 18.167573305039239953, 19.063717908096738445,
    19.870248050848487088};

TEST(BouncingBall, ImpactTimesAreTheSumOfAGeometricSeries)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    for (int n = 0; n < 13; ++n) {
        // One rounding of the sum, 1.8e-15, and the rounding of 0.9 and 9.81 to
        // doubles: 2.3e-17 in r times dt/dr < 150 s, 1.5e-16 relative in g.
        EXPECT_NEAR(ball.impact_time(n, 10), paper_impacts[static_cast<std::size_t>(n)], 7e-15);
    }
}

TEST(BouncingBall, ImpactsAccumulateAtTheZenoTime)
{
    EXPECT_NEAR(BouncingBall().zeno_time(10), 27.129019335614225, 1e-14);
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.7});
    EXPECT_NEAR(ball.zeno_time(1), 2.55863396558580846, 1e-15);
    EXPECT_NEAR(ball.impact_time(200, 1), ball.zeno_time(1), 1e-14);
}

TEST(BouncingBall, ABallThrownUpFirstRisesThenFalls)
{
    // From height 1 m at 3 m/s under 10 m/s2: 1 + 3 t - 5 t^2 = 0 at (3 + sqrt 29) / 10.
    const BouncingBall ball({.gravity = 10, .restitution = 0.5});
    EXPECT_NEAR(ball.first_impact(1, 3), (3 + std::sqrt(29.0)) / 10, 1e-15);
    EXPECT_NEAR(ball.first_impact(1, -3), (-3 + std::sqrt(29.0)) / 10, 1e-15);
}

TEST(BouncingBall, AnElasticBallNeverRests)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 1});
    EXPECT_EQ(ball.zeno_time(1), std::numeric_limits<double>::infinity());
}

TEST(BouncingBall, ParametersOutsideTheirRangeAreNamed)
{
    const auto message = [](const BouncingBall::Parameters& parameters) -> std::string {
        try {
            const BouncingBall ball(parameters);
            return "accepted";
        } catch (const std::invalid_argument& refusal) {
            return refusal.what();
        }
    };
    EXPECT_EQ(message({.gravity = 9.81, .restitution = 1.2}),
              "BouncingBall: restitution must lie in [0, 1], got 1.2");
    EXPECT_EQ(message({.gravity = 0, .restitution = 0.5}),
              "BouncingBall: gravity must be positive and finite [m/s2], got 0");
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_NE(message({.gravity = nan, .restitution = 0.5}), "accepted");
    EXPECT_NE(message({.gravity = 9.81, .restitution = nan}), "accepted");
    EXPECT_NE(message({.gravity = 9.81, .restitution = -0.1}), "accepted");
}

}  // namespace
}  // namespace ricochet::bouncing_ball_test
