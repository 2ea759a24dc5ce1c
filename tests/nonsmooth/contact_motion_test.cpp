// Flight by events and contact by time stepping in one run.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "ricochet/nonsmooth/contact_motion.hpp"
#include "ricochet/systems/two_contact_block.hpp"
#include "ricochet/systems/woodpecker.hpp"

namespace ricochet::contact_motion_test {
namespace {

/// A point of 1 kg over a floor with friction that may move up and down.
struct Ball {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    using V = Eigen::Vector2d;
    double e = 0.5;
    double mu = 0.2;
    double lift = 0;      ///< [m/s^2], a pull upward
    double lift_at = 10;  ///< [s], from then on
    static void mass(const V&, Eigen::Matrix2d& m) { m.setIdentity(); }
    void force(double t, const V&, const V&, V& f) const
    {
        f << 0, -10 + (t >= lift_at ? lift : 0);
    }
    static void gaps(const V& q, Eigen::Matrix<double, 1, 1>& g) { g[0] = q[1]; }
    static void directions(const V&, Eigen::Matrix2d& h) { h << 0, 1, 1, 0; }
    [[nodiscard]] double restitution(int) const { return e; }
    [[nodiscard]] double friction(int) const { return mu; }
};

// Dropped from 0.8 m under 10 m/s^2: the first impact is at 0.4 s with 4 m/s, the flights
// after it last 0.8 s e^n, and they end at 0.4 + 0.8 e / (1 - e) = 1.2 s for e = 1/2. All
// impulses of the floor up to then are 12 N s, the weight over that time, so that sliding friction
// reduces the velocity by 0.2 of that, the same as afterwards.

TEST(ContactMotion, ImpactsAccumulateIntoSlidingAndRest)
{
    const double h = 1e-3;
    const auto run =
        hand_over(Ball{}, {0, 0.8}, {4, 0},
                  {.t_end = 3, .set_valued = {.step = h}, .sample_times = {0.4, 1.0, 1.5, 3}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_GE(run.events.size(), 20U);
    double t = 0.4;
    double u = 4;
    for (int n = 0; n < 20; ++n) {
        const auto& impact = run.events[static_cast<std::size_t>(n)];
        const double speed = 4 * std::pow(0.5, n);  // just before it, downward
        u -= 0.2 * 1.5 * speed;
        EXPECT_NEAR(impact.t, t, 1e-14 * (n + 1)) << n;
        EXPECT_NEAR(impact.after[2], u, 1e-12) << n;
        EXPECT_NEAR(impact.after[3], speed / 2, 1e-12) << n;
        t += speed / 10;
    }
    ASSERT_EQ(run.phases.size(), 2U);
    EXPECT_TRUE(run.phases[1].set_valued);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::accumulation);
    EXPECT_NEAR(run.phases[1].from, 1.2, 1e-9);
    // While it slides: 4 - 0.2 * 10 t; at rest from 2 s.
    EXPECT_NEAR(run.trajectory.x[2][2], 1, 1e-9);
    EXPECT_NEAR(run.x[2], 0, 1e-12);
    EXPECT_NEAR(run.x[3], 0, 1e-12);
    EXPECT_NEAR(run.x[1], 0, 10 * h * h);  // distance that a body may fall in a step before the
                                           // contact is closed
    EXPECT_EQ(run.t, 3);
}

TEST(ContactMotion, GoesBackToFlightWhereTheContactOpens)
{
    // At rest until a pull of 14 m/s^2 sets in: then up with 4 m/s^2. The step in which it
    // opens has the length h, which determines the error of the height.
    for (const double h : {1e-3, 1e-4}) {
        const auto run = hand_over(Ball{.lift = 14, .lift_at = 1}, {0, 0}, {0, 0},
                                   {.t_end = 2, .set_valued = {.step = h}});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        ASSERT_EQ(run.phases.size(), 3U);
        EXPECT_EQ(run.phases[2].cause, PhaseCause::released);
        EXPECT_FALSE(run.phases[2].set_valued);
        EXPECT_NEAR(run.phases[2].from, 1, 4 * h);
        EXPECT_NEAR(run.x[1], 2, 8 * h);
        EXPECT_NEAR(run.x[3], 4, 8 * h);
    }
}

TEST(ContactMotion, ABlockThatFallsOnTwoCornersComesToRest)
{
    // Tilted, so that one corner strikes first and the two take turns.
    TwoContactBlock block;
    block.bounce = 0.3;
    const auto run =
        hand_over(block, {0, 0.3, 0.05}, {1, 0, 0}, {.t_end = 4, .set_valued = {.step = 1e-3}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.events.size(), 10U);
    EXPECT_GT(run.statistics.contact_time, 1);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(run.x[3 + i], 0, 1e-8) << i;
    EXPECT_NEAR(run.x[2], 0, 1e-4);
    // Friction of both corners stops the remaining motion.
    EXPECT_GT(run.x[0], 0);
}

TEST(ContactMotion, TheWoodpeckerDescendsAsUnderTimeSteppingAlone)
{
    // A sleeve that jams and slides is in contact most of the time; its beak strikes in
    // between. Both methods are of order 1 there, so the descents agree to some steps.
    const Woodpecker toy;
    const double h = 1e-5;
    const auto run = hand_over(toy, Woodpecker::start(), Woodpecker::start_velocity(),
                               {.t_end = 1, .set_valued = {.step = h}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.statistics.to_flight, 2U);
    TimeStepping<Woodpecker> steps(toy, Woodpecker::start(), Woodpecker::start_velocity(),
                                   {.t_end = 1, .step = h});
    ASSERT_EQ(steps.run(), Outcome::reached_end);
    EXPECT_NEAR(run.x[0], steps.state().q[0], 0.02 * std::abs(steps.state().q[0]));
}

/// A point of 1 kg that is pushed into the corner of a floor and a wall at x = 1, both with
/// friction.
struct Corner {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 2;
    static constexpr int tangents = 1;
    using V = Eigen::Vector2d;
    static void mass(const V&, Eigen::Matrix2d& m) { m.setIdentity(); }
    static void force(double, const V&, const V&, V& f) { f << 2, -9.81; }
    static void gaps(const V& q, V& g) { g << q[1], 1 - q[0]; }
    static void directions(const V&, Eigen::Matrix<double, 4, 2>& h)
    {
        h << 0, 1, 1, 0, -1, 0, 0, 1;
    }
    static double restitution(int) { return 0.4; }
    static double friction(int c) { return c == 0 ? 0.1 : 0.3; }
};

TEST(ContactMotion, APointComesToRestInACorner)
{
    for (const double step : {1e-3, 1e-4}) {
        for (int k = 0; k < 40; ++k) {
            const Eigen::Vector2d start(0.5, 0.3 + 0.01 * k);
            const auto run = hand_over(Corner{}, start, Eigen::Vector2d(1, 0),
                                       {.t_end = 3, .set_valued = {.step = step}});
            ASSERT_EQ(run.outcome, Outcome::reached_end) << step << ' ' << start[1];
            EXPECT_LT(std::abs(run.x[2]) + std::abs(run.x[3]), 1e-9);
            // Steps leave a penetration of the order of the force times the step squared.
            EXPECT_NEAR(run.x[0], 1, 20 * step * step);
            EXPECT_NEAR(run.x[1], 0, 20 * step * step);
        }
    }
}

TEST(ContactMotion, StopsAfterSoManySteps)
{
    const auto run = hand_over(Ball{}, {0, 0.8}, {4, 0},
                               {.t_end = 3, .set_valued = {.step = 1e-3}, .max_steps = 500});
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    EXPECT_EQ(run.statistics.event_driven.steps + run.statistics.time_stepping.steps, 500U);
    EXPECT_GT(run.t, 1.2);
    EXPECT_LT(run.t, 2);
}

/// A ball on a floor that a force lifts again and again.
struct LiftedBall {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    using V = Eigen::Vector2d;
    static void mass(const V&, Eigen::Matrix2d& m) { m.setIdentity(); }
    static void force(double t, const V&, const V&, V& f) { f << 0, -9.81 + 30 * std::sin(7 * t); }
    static void gaps(const V& q, Eigen::Matrix<double, 1, 1>& g) { g << q[1]; }
    static void directions(const V&, Eigen::Matrix2d& h) { h << 0, 1, 1, 0; }
    static double restitution(int) { return 0.3; }
    static double friction(int) { return 0.2; }
};

TEST(ContactMotion, CountsStepsInContactAgainstTheLimitOfLaterFlights)
{
    const auto steps = [](const auto& run) {
        return run.statistics.event_driven.steps + run.statistics.time_stepping.steps;
    };
    const LiftedBall::V q(0, 0.1);
    const LiftedBall::V v(3, 0);
    const HandOverOptions options{.t_end = 7, .set_valued = {.step = 1e-2}};
    const auto whole = hand_over(LiftedBall{}, q, v, options);
    ASSERT_EQ(whole.outcome, Outcome::reached_end);
    ASSERT_FALSE(whole.phases.back().set_valued);
    ASSERT_GT(whole.statistics.time_stepping.steps, 1U);
    HandOverOptions fewer = options;
    fewer.max_steps = steps(whole) - 1;
    const auto run = hand_over(LiftedBall{}, q, v, fewer);
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    EXPECT_EQ(steps(run), fewer.max_steps);
    EXPECT_LT(run.t, 7);
}

/// A particle between two walls without friction; its mass matrix couples both coordinates.
struct Shuttle {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 2;
    static constexpr int tangents = 1;
    using V = Eigen::Vector2d;
    static void mass(const V&, Eigen::Matrix2d& m) { m << 1.3, 0.4, 0.4, 0.7; }
    static void force(double, const V&, const V&, V& f) { f.setZero(); }
    static void gaps(const V& q, V& g) { g << q[1], 1 - q[1]; }
    static void directions(const V&, Eigen::Matrix<double, 4, 2>& h)
    {
        h << 0, 1, 1, 0, 0, -1, 1, 0;
    }
    static double restitution(int) { return 1; }
    static double friction(int) { return 0; }
};

TEST(ContactMotion, ElasticImpactsKeepTheEnergyToRounding)
{
    const auto run = hand_over(Shuttle(), {0, 0.5}, {0.3, 1}, {.t_end = 200});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_GT(run.events.size(), 100U);
    Eigen::Matrix2d m;
    Shuttle::mass({}, m);
    const auto energy = [&](const auto& x) {
        const Eigen::Vector2d v(x[2], x[3]);
        return v.dot(m * v) / 2;
    };
    const double start = energy(detail::FreeFlight<Shuttle>::state({0, 0.5}, {0.3, 1}));
    // Some ten operations per impact are rounded, each by at most 1.1e-16.
    for (const auto& impact : run.events) {
        EXPECT_NEAR(energy(impact.after), energy(impact.before), 2e-15 * start) << impact.t;
    }
    EXPECT_NEAR(energy(run.x), start, 2e-15 * start * static_cast<double>(run.events.size()));
}

TEST(ContactMotion, AForceThatIsNotFiniteInContactEndsTheRun)
{
    const auto run = hand_over(Ball{.lift = std::nan(""), .lift_at = 1}, {0, 0}, {0, 0},
                               {.t_end = 2, .set_valued = {.step = 1e-2}});
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_GT(run.t, 0.98);
    EXPECT_LT(run.t, 1.01);
    EXPECT_TRUE(std::isfinite(run.x[1]));
}

TEST(ContactMotion, ARunOfNoLengthIsOver)
{
    for (const double height : {0.0, 1.0}) {
        const auto run =
            hand_over(Ball{}, {0, height}, {0, 0}, {.t_start = 1, .t_end = 1, .sample_times = {1}});
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.t, 1);
        ASSERT_EQ(run.trajectory.t.size(), 1U);
        EXPECT_EQ(run.trajectory.x[0][1], height);
    }
}

TEST(ContactMotion, NoLimitOfStepsIsPassedWhereContactBegins)
{
    const auto with = [](std::uint64_t most) {
        return hand_over(Ball{}, {0, 0.8}, {4, 0}, {.t_end = 3, .max_steps = most});
    };
    const std::uint64_t flight = with(1'000'000).statistics.event_driven.steps;
    for (std::uint64_t most = flight - 1; most <= flight + 2; ++most) {
        const auto run = with(most);
        EXPECT_EQ(run.outcome, Outcome::step_limit);
        EXPECT_EQ(run.statistics.event_driven.steps + run.statistics.time_stepping.steps, most);
    }
}

TEST(ContactMotion, RefusesAStartInsideAnObstacle)
{
    EXPECT_THROW((void)hand_over(Ball{.mu = std::numeric_limits<double>::infinity()}, {0, 1},
                                 {0, 0}, {.t_end = 1}),
                 std::invalid_argument);
    try {
        (void)hand_over(Ball{}, {0, std::nan("")}, {0, 0}, {.t_end = 1});
        ADD_FAILURE() << "accepted";
    } catch (const std::invalid_argument& error) {
        EXPECT_NE(std::string(error.what()).find("not finite"), std::string::npos);
    }
    EXPECT_THROW((void)hand_over(Ball{}, {0, -0.1}, {0, 0}, {.t_end = 1}), std::invalid_argument);
    EXPECT_THROW((void)hand_over(Ball{.mu = -1}, {0, 1}, {0, 0}, {.t_end = 1}),
                 std::invalid_argument);
}

/// The puck of docs/contact.md, kicked every second, with a wall at 1 m.
struct Puck : Ball {
    static void mass(const V&, Eigen::Matrix2d& m) { m = Eigen::Vector2d(0.16, 0.16).asDiagonal(); }
    static void force(double, const V&, const V&, V& f) { f << 0, -9.81 * 0.16; }
};
struct Kicked : Puck {
    using State = std::array<double, 4>;
    static double guard(double, const State& x) { return 1 - x[0]; }
    static void reset(double, State& x) { x[2] = -x[2]; }
    static double next_time_event(double t) { return std::floor(t) + 1; }
    static void time_reset(double, State& x) { x[2] += 1; }
};
/// Three coordinates, two contacts in space, a mass matrix that changes.
struct Plate {
    static constexpr int coordinates = 3, contacts = 2, tangents = 2;
    using V = Eigen::Vector3d;
    static void mass(const V& q, Eigen::Matrix3d& m)
    {
        m << 2, 0.1 + 0.01 * q[0], 0.2, 0.1 + 0.01 * q[0], 1, 0.05, 0.2, 0.05, 3;
    }
    static void force(double t, const V& q, const V& v, V& f)
    {
        f << 0.3 * t - 0.2 * q[0], -9.81 - v[1], 0.1 * q[1] - 0.5 * v[2];
    }
    static void gaps(const V& q, Eigen::Vector2d& g) { g << q[1], q[1] + 0.1 * q[2] + 0.3; }
    static void directions(const V&, Eigen::Matrix<double, 6, 3>& h)
    {
        h << 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0.1, 1, 0, 0.5, 0, 0, 1;
    }
    static double restitution(int c) { return c == 0 ? 0.6 : 0.4; }
    static double friction(int c) { return c == 0 ? 0.3 : 0.1; }
};

/// Compares the sum of the times of all events, and the end.
template <class Run>
void expect_bits(const Run& run, std::size_t events, double times, const std::vector<double>& end)
{
    ASSERT_EQ(run.events.size(), events);
    double sum = 0;
    for (const auto& event : run.events) sum += event.t;
    EXPECT_EQ(sum, times);
    for (std::size_t i = 0; i < end.size(); ++i) EXPECT_EQ(run.x[i], end[i]) << i;
}

TEST(ContactMotion, RunsHaveTheBitsThatTheyHaveInPython)
{
    // The same numbers are in tests/python/mechanism_test.py, whose states are vectors.
    expect_bits(hand_over(Puck{}, {0, 0.1}, {3, 0}, {.t_end = 4, .set_valued = {.step = 1e-4}}), 49,
                0x1.46b0c509219bep+4, {0x1.282352e041aebp+1, -0x1.18e40f7a0f3fep-24, 0, 0});
    expect_bits(hand_over(Kicked{}, {0, 0}, {2, 0}, {.t_end = 4}), 8, 0x1.1405c80e94586p+4,
                {0x1.90f6a6dddc912p-1, -0x1.b6d024264562bp-14, 1, -0x1p-58});
    expect_bits(hand_over(Plate{}, {0.1, 0.5, 0.2}, {1, 0, -0.3},
                          {.t_end = 3, .set_valued = {.step = 1e-3}}),
                66, 0x1.18560054bf007p+6,
                {0x1.2e62d9b65e23fp-1, -0x1.9e741c58933fbp-18, 0x1.64d0fdcc01427p-4, -0x1p-63,
                 -0x1p-59, 0});
}

}  // namespace
}  // namespace ricochet::contact_motion_test
