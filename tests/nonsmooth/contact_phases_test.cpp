// Mechanisms with guards, time events, modes, moving surfaces and dry friction of coordinates;
// their snapshots, samples and forces.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "refusal.hpp"
#include "ricochet/nonsmooth/contact_motion.hpp"

namespace ricochet::contact_phases_test {
namespace {

using V1 = Eigen::Matrix<double, 1, 1>;
using V2 = Eigen::Vector2d;

/// A point of 1 kg over a floor with friction 0.2 under 10 m/s^2; q = (way, height).
struct Puck {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    using State = std::array<double, 4>;
    static void mass(const V2&, Eigen::Matrix2d& m) { m.setIdentity(); }
    static void force(double, const V2&, const V2&, V2& f) { f << 0, -10; }
    static void gaps(const V2& q, V1& g) { g[0] = q[1]; }
    static void directions(const V2&, Eigen::Matrix2d& h) { h << 0, 1, 1, 0; }
    static double restitution(int) { return 0; }
    static double friction(int) { return 0.2; }
};

// --- guards and time events ---

/// It meets a wall at 1 m, which returns its speed.
struct Walled : Puck {
    static double guard(double, const State& x) { return 1 - x[0]; }
    static void reset(double, State& x) { x[2] = -x[2]; }
};

TEST(ContactPhases, AGuardIsLocatedWhileTheContactIsClosed)
{
    // 2.5 t - t^2 = 1 at 1/2 s, with 1.5 m/s, which friction of 2 m/s^2 takes in 0.75 s, over
    // 9/16 m. Velocities are linear and positions quadratic in time, on which a step of Moreau's
    // of any length is exact, so that the solver's tolerance of 1e-10 is what is left.
    const auto run =
        hand_over(Walled{}, {0, 0}, {2.5, 0}, {.t_end = 2, .set_valued = {.step = 1e-2}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.phases.size(), 2U);
    std::vector<Event<Puck::State>> walls;
    for (const auto& event : run.events) {
        if (event.guard == 1) walls.push_back(event);
    }
    ASSERT_EQ(walls.size(), 1U);
    EXPECT_EQ(walls[0].kind, EventKind::crossing);
    EXPECT_NEAR(walls[0].t, 0.5, 1e-9);
    EXPECT_NEAR(walls[0].before[2], 1.5, 1e-9);
    EXPECT_NEAR(walls[0].after[2], -1.5, 1e-9);
    EXPECT_NEAR(run.x[0], 1 - 9.0 / 16, 1e-8);
    EXPECT_NEAR(run.x[2], 0, 1e-12);
}

TEST(ContactPhases, AResetThatDrivesABodyIntoItsObstacleEndsTheRun)
{
    struct Driven : Puck {
        double to = 0;
        static double next_time_event(double t)
        {
            return t < 1 ? 1 : std::numeric_limits<double>::infinity();
        }
        void time_reset(double, State& x) const { x[1] = to; }
    };
    const auto driven = [](double to, double height) {
        Driven system;
        system.to = to;
        return hand_over(system, {0, height}, {0, 0}, {.t_end = 2});
    };
    const auto in = driven(-0.2, 0);
    EXPECT_EQ(in.outcome, Outcome::outside_mode);
    EXPECT_EQ(in.t, 1);
    EXPECT_EQ(in.reason, "a reset drives contact 0 into its obstacle at t = 1");
    EXPECT_EQ(driven(0, 0).outcome, Outcome::reached_end);
    EXPECT_EQ(driven(0.5, 0).outcome, Outcome::reached_end);
    EXPECT_EQ(driven(-0.2, 30).outcome, Outcome::outside_mode);
}

TEST(ContactPhases, AGuardIsWatchedInFlightToo)
{
    // From 5 m: 0.4 s at 2.5 m/s to the wall, and the impact at 1 s takes 0.2 times 10 m/s of the
    // speed.
    const auto run =
        hand_over(Walled{}, {0, 5}, {2.5, 0}, {.t_end = 2, .set_valued = {.step = 1e-2}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_GE(run.events.size(), 2U);
    EXPECT_EQ(run.events[0].guard, 1U);
    EXPECT_NEAR(run.events[0].t, 0.4, 1e-12);
    EXPECT_EQ(run.events[1].guard, 0U);
    EXPECT_NEAR(run.events[1].t, 1, 1e-12);
    EXPECT_NEAR(run.events[1].after[2], -0.5, 1e-12);
    EXPECT_NEAR(run.x[0], -0.5 - 0.5 * 0.5 / 4, 1e-8);
}

/// It is kicked every second.
struct Kicked : Puck {
    static double next_time_event(double t) { return std::floor(t) + 1; }
    static void time_reset(double, State& x) { x[2] += 1; }
};

TEST(ContactPhases, TimeEventsActOnWhatLies)
{
    // Each kick moves it by 1/4 m in half a second.
    const auto run = hand_over(
        Kicked{}, {0, 0}, {0, 0},
        {.t_end = 3.75, .set_valued = {.step = 1e-2}, .sample_times = {0.5, 1, 1.25, 1.9, 3.7}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    int kicks = 0;
    for (const auto& event : run.events) kicks += event.kind == EventKind::time;
    EXPECT_EQ(kicks, 3);
    EXPECT_NEAR(run.x[0], 0.75, 1e-9);
    ASSERT_EQ(run.trajectory.x.size(), 5U);
    const double at[] = {0, 0, 0.25 - 1.0 / 16, 0.25, 0.75};
    // Samples lie on chords of steps: 2 h^2 / 8 from the parabola.
    for (std::size_t k = 0; k < 5; ++k) EXPECT_NEAR(run.trajectory.x[k][0], at[k], 2.6e-5) << k;
}

/// Body A lies on the floor, body B falls onto it beside A without restitution.
struct Pair {
    static constexpr bool resets = false;
    static constexpr int coordinates = 2;
    static constexpr int contacts = 2;
    static constexpr int tangents = 1;
    using State = std::array<double, 4>;
    static void mass(const V2&, Eigen::Matrix2d& m) { m.setIdentity(); }
    static void force(double, const V2&, const V2&, V2& f) { f << -10, -10; }
    static void gaps(const V2& q, V2& g) { g = q; }
    static void directions(const V2&, Eigen::Matrix<double, 4, 2>& h)
    {
        h << 1, 0, 0, 0, 0, 1, 0, 0;
    }
    static double restitution(int) { return 0; }
    static double friction(int) { return 0; }
    static constexpr std::size_t guard_count = 2;
    static GuardInfo guard_info(std::size_t i)
    {
        return {.crossing = i == 0 ? Crossing::falling : Crossing::rising, .resets = false};
    }
    static double guard(std::size_t i, double, const State& x) { return x[3] + (i == 0 ? 2 : 0.5); }
};

TEST(ContactPhases, AGuardOfAVelocityThatJumpsIsKnownToAStep)
{
    // B passes -2 m/s at 0.2 s, and loses 5 m/s at 0.5 s.
    for (const double h : {1e-2, 1e-3}) {
        const auto run =
            hand_over(Pair{}, {0, 1.25}, {0, 0}, {.t_end = 1, .set_valued = {.step = h}});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        std::vector<Event<Pair::State>> seen;
        for (const auto& event : run.events) {
            if (event.guard >= 2) seen.push_back(event);
        }
        ASSERT_EQ(seen.size(), 2U);
        EXPECT_EQ(seen[0].guard, 2U);
        EXPECT_NEAR(seen[0].t, 0.2, h);
        EXPECT_EQ(seen[1].guard, 3U);
        EXPECT_NEAR(seen[1].t, 0.5, h);
        EXPECT_NEAR(run.x[3], 0, 1e-12);
    }
}

/// A motor pulls in mode 1: from 1 s on, and until 2 m are reached.
struct Pulled : Puck {
    static constexpr std::size_t mode_count = 2;
    static void force(Mode mode, double, const V2&, const V2&, V2& f)
    {
        f << (mode == 1 ? 6 : 0), -10;
    }
    static double guard(Mode, double, const State& x) { return x[0] - 2; }
    static GuardInfo guard_info() { return {.crossing = Crossing::rising}; }
    static Mode reset(Mode, double, State&) { return 0; }
    static double next_time_event(double t) { return t < 1 ? 1 : INFINITY; }
    static Mode time_reset(Mode, double, State&) { return 1; }
};

TEST(ContactPhases, AMechanismHasModes)
{
    // 4 m/s^2 from 1 s on: 2 m at 2 s with 4 m/s, then -2 m/s^2 for 4 m.
    const auto run =
        hand_over(Pulled{}, {0, 0}, {0, 0}, {.t_end = 5, .set_valued = {.step = 1e-2}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.mode, 0U);
    EXPECT_NEAR(run.x[0], 6, 1e-7);
    for (const auto& event : run.events) {
        if (event.guard != 1) continue;
        EXPECT_NEAR(event.t, 2, 1e-9);
        EXPECT_EQ(event.mode_before, 1U);
        EXPECT_EQ(event.mode_after, 0U);
    }
}

/// A bar with two lower corners over a shaken floor, between walls that return it, kicked
/// and pulled, with dry friction of its guide and its hinge.
struct Bar {
    static constexpr int coordinates = 3;
    static constexpr int contacts = 2;
    static constexpr int tangents = 1;
    using State = std::array<double, 6>;
    using V3 = Eigen::Vector3d;
    double mass_of_bar = 1, inertia = 0.1, width = 0.3, height = 0.2, coefficient = 0.3, e = 0.3;
    double amplitude = 0.01, w = 20, guide = 0, hinge = 0, pull = 0, wall = 0.5, period = 0.37;

    void mass(const V3&, Eigen::Matrix3d& m) const
    {
        m = V3(mass_of_bar, mass_of_bar, inertia).asDiagonal();
    }
    void force(double t, const V3&, const V3&, V3& f) const
    {
        f << pull * std::sin(3 * t), -10 * mass_of_bar, 0;
    }
    void gaps(double t, const V3& q, V2& gap) const
    {
        for (int k = 0; k < 2; ++k) {
            const double s = k == 0 ? -width : width;
            gap[k] =
                q[1] + s * std::sin(q[2]) - height * std::cos(q[2]) - amplitude * std::sin(w * t);
        }
    }
    void directions(const V3& q, Eigen::Matrix<double, 4, 3>& h) const
    {
        for (int k = 0; k < 2; ++k) {
            const double s = k == 0 ? -width : width;
            h.row(2 * k) << 0, 1, s * std::cos(q[2]) + height * std::sin(q[2]);
            h.row(2 * k + 1) << 1, 0, -s * std::sin(q[2]) + height * std::cos(q[2]);
        }
    }
    void surface_rates(double t, const V3&, Eigen::Vector4d& b) const
    {
        const double rate = -amplitude * w * std::cos(w * t);
        b << rate, rate / 2, rate, rate / 2;
    }
    [[nodiscard]] double restitution(int) const { return e; }
    [[nodiscard]] double friction(int) const { return coefficient; }
    [[nodiscard]] double dry_friction(int i) const { return i == 0 ? guide : i == 2 ? hinge : 0; }
    static constexpr std::size_t guard_count = 2;
    [[nodiscard]] double guard(std::size_t i, double, const State& x) const
    {
        return wall + (i == 0 ? -x[0] : x[0]);
    }
    static void reset(std::size_t, double, State& x) { x[3] = -0.8 * x[3]; }
    [[nodiscard]] double next_time_event(double t) const
    {
        const double next = (std::floor(t / period) + 1) * period;
        return next > t ? next : next + period;
    }
    static void time_reset(double, State& x) { x[3] += 0.7; }
};

TEST(ContactPhases, RandomBarsStayOverTheFloorAndBetweenTheWallsAndGoOnFromSnapshots)
{
    int ended = 0;
    for (std::uint64_t seed = 1; seed <= 200; ++seed) {
        std::mt19937_64 random(seed);
        const auto draw = [&](double low, double high) {
            return low + (high - low) * std::generate_canonical<double, 53>(random);
        };
        Bar bar{.mass_of_bar = draw(0.2, 3),
                .inertia = draw(0.02, 0.3),
                .width = draw(0.1, 0.5),
                .height = draw(0.05, 0.4),
                .coefficient = draw(0, 0.6),
                .e = seed % 2 ? draw(0, 0.8) : 0,
                .amplitude = draw(0, 0.03),
                .w = draw(5, 40)};
        if (seed % 5 < 2) bar.guide = draw(0, 2);
        if (seed % 7 < 2) bar.hinge = draw(0, 0.3);
        bar.pull = draw(0, 5);
        bar.wall = draw(0.2, 1);
        bar.period = draw(0.2, 0.6);
        const Bar::V3 q(0, draw(0.8, 1.5), draw(-0.5, 0.5)), v(draw(-1, 1), 0, draw(-1, 1));
        const HandOverOptions options{.t_end = 3, .set_valued = {.step = 1e-3}};
        const auto run = hand_over(bar, q, v, options);
        // A pull against a wall makes its impacts accumulate.
        const bool at_wall = run.outcome == Outcome::zeno && run.guard >= 2;
        ASSERT_TRUE(run.outcome == Outcome::reached_end || at_wall) << seed;
        ended += run.outcome == Outcome::reached_end;
        V2 gaps;
        bar.gaps(run.t, detail::FreeFlight<Bar>::position(run.x), gaps);
        // Corners fall at 8 m/s at most: 2 h after which a contact is closed.
        EXPECT_GT(gaps.minCoeff(), -16e-3) << seed;
        EXPECT_LT(std::fabs(run.x[0]), bar.wall + 1e-9) << seed;

        ContactMotion motion(bar, q, v, options);
        const int steps = 50 + static_cast<int>(seed % 23) * 40;
        for (int i = 0; i < steps && !motion.ended(); ++i) static_cast<void>(motion.step());
        ContactMotion again(bar, q, v, options);
        again.restore(motion.save());
        const auto rest = again.take();
        EXPECT_EQ(rest.t, run.t) << seed;
        EXPECT_EQ(rest.x, run.x) << seed;
    }
    EXPECT_GT(ended, 180);
}

/// Ends at half a metre.
struct Ended : Puck {
    static constexpr bool resets = false;
    static double guard(double, const State& x) { return 0.5 - x[0]; }
    static GuardInfo guard_info() { return {.stop_after = 1}; }
};

TEST(ContactPhases, AGuardEndsTheRunInContact)
{
    // 1.5 t - t^2 = 1/2.
    const auto run =
        hand_over(Ended{}, {0, 0}, {1.5, 0}, {.t_end = 5, .set_valued = {.step = 1e-2}});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.guard, 1U);
    EXPECT_NEAR(run.t, 0.5, 1e-9);
}

TEST(ContactPhases, AGuardEndsARunWithoutAnEndOfItsOwn)
{
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const auto run =
        hand_over(Ended{}, {0, 0}, {1.5, 0}, {.t_end = infinity, .set_valued = {.step = 1e-2}});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 0.5, 1e-9);
    ContactMotion<Ended> driven({}, {0, 0}, {1.5, 0}, Options{.t_end = infinity}, 1e-2);
    while (driven.step()) {
    }
    EXPECT_NEAR(driven.t(), 0.5, 1e-9);
    EXPECT_EQ(refusal([&] {
                  (void)hand_over(Ended{}, {0, 0}, {1.5, 0}, {.t_end = infinity});
              }),
              "HandOverOptions: found an infinite t_end and no set_valued.step, which is then no "
              "thousandth of the run; expected the length [s] of the set-valued steps");
    EXPECT_EQ(
        refusal([&] {
            const ContactMotion<Ended> endless({}, {0, 0}, {1.5, 0}, Options{.t_end = infinity}, 0);
        }),
        "ContactMotion: found an infinite t_end and no step, which is then no thousandth of "
        "the run; expected the length [s] of the steps in contact");
}

/// A ball of its own above the puck's floor, whose impacts the system describes by a guard.
struct Beside : Puck {
    static void force(double, const V2&, const V2&, V2& f) { f << -1, -10; }
    static double friction(int) { return 0; }
    static double guard(double, const State& x) { return x[0]; }
    static GuardInfo guard_info() { return {.unilateral = true}; }
    static void reset(double, State& x) { x[2] = -0.5 * x[2]; }
};

TEST(ContactPhases, AnAccumulationOfADeclaredGuardIsNoContact)
{
    // From 1/2 m by 1 m/s^2: 1 s, and flights of 2 s (1/2)^k with e = 1/2.
    for (const double height : {0.0, 1000.0}) {
        const auto run =
            hand_over(Beside{}, {0.5, height}, {0, 0}, {.t_end = 9, .set_valued = {.step = 1e-3}});
        EXPECT_EQ(run.outcome, Outcome::zeno) << height;
        EXPECT_EQ(run.guard, 1U);
        EXPECT_NEAR(run.t, 3, height == 0 ? 2e-3 : 1e-9);
    }
}

// --- surfaces that move ---

/// A ball on a plate at height a sin(w t), under 10 m/s^2.
struct Shaken {
    static constexpr int coordinates = 1;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    double a = 0.1, w = 20, e = 0;
    double wrong = 0;
    static void mass(const V1&, V1& m) { m << 1; }
    static void force(double, const V1&, const V1&, V1& f) { f << -10; }
    void gaps(double t, const V1& q, V1& g) const { g[0] = q[0] - a * std::sin(w * t); }
    static void directions(const V1&, V2& h) { h << 1, 0; }
    void surface_rates(double t, const V1&, V2& b) const
    {
        b << -a * w * std::cos(w * t) + wrong, 0;
    }
    [[nodiscard]] double restitution(int) const { return e; }
    static double friction(int) { return 0; }
};

TEST(ContactPhases, ABallStrikesAMovingPlateWhereItIs)
{
    // From 1 m: 1 - 5 t^2 = 0.1 sin 20 t, located to rounding, and v+ = p' + e (p' - v-).
    const Shaken plate{.e = 0.5};
    double t = 0;
    while (1 - 5 * t * t > plate.a * std::sin(plate.w * t)) t += 1e-4;
    for (int i = 0; i < 20; ++i) {
        const double gap = 1 - 5 * t * t - plate.a * std::sin(plate.w * t);
        t += gap / (10 * t + plate.a * plate.w * std::cos(plate.w * t));
    }
    ContactMotion motion(plate, V1(1), V1(0), {.t_end = 1, .stop_at_event = true}, 1e-3);
    const auto run = motion.take();
    ASSERT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, t, 1e-12);
    const double speed = plate.a * plate.w * std::cos(plate.w * t);
    EXPECT_NEAR(run.x[1], speed + 0.5 * (speed + 10 * t), 1e-9);
}

TEST(ContactPhases, ABallRidesAPlateUntilItFallsFasterThanTheBall)
{
    // The ball lies on it until a w^2 sin(w t) = 10, pressed by 10 - a w^2 sin(w t), and is thrown
    // with the plate's speed. A step is exact at its ends in the velocity, and second order in the
    // position; the release is known to a step, which shifts the flight by that.
    const Shaken plate;
    const double t1 = std::asin(10 / (plate.a * plate.w * plate.w)) / plate.w;
    const double y1 = plate.a * std::sin(plate.w * t1),
                 v1 = plate.a * plate.w * std::cos(plate.w * t1);
    for (const double h : {1e-4, 1e-5}) {
        const double at = 0.5 * t1;
        const auto run = hand_over(
            plate, V1(0), V1(plate.a * plate.w),
            {.t_end = t1 + 0.1, .set_valued = {.step = h}, .sample_times = {at, t1 + 0.1}});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_NEAR(run.trajectory.x[0][0], plate.a * std::sin(plate.w * at), 40 * h * h);
        const double force = 10 - plate.a * plate.w * plate.w * std::sin(plate.w * at);
        // Its rate is a w^3 = 800 N/s.
        EXPECT_NEAR(run.forces[0].contacts[0], force, 801 * h);
        EXPECT_EQ(run.forces[1].contacts[0], 0);
        ASSERT_EQ(run.phases.back().cause, PhaseCause::released);
        // It has sunk by the fall over a step before the contact closes, 10 h^2, and some more by
        // the trapezium rule. The contact opens where a w^3 s^3 / 6 has raised it by that.
        const double opens = std::cbrt(6 * 12 * h * h / 800);
        EXPECT_GT(run.phases.back().from, t1 - 2 * h);
        EXPECT_LT(run.phases.back().from, t1 + opens + 2 * h);
        // What differs in the fall from the plate's motion: a w^3 (2 h)^2 / 2 in the speed.
        EXPECT_NEAR(run.x[0], y1 + 0.1 * v1 - 0.05, 2000 * h * h);
    }
}

/// A belt that runs at 2 m/s under the puck.
struct Belt : Puck {
    static void surface_rates(double, const V2&, V2& b) { b << 0, -2; }
};

/// A ball on a plate, at `height` with the speed `speed`, under a load.
struct OnAPlate {
    static constexpr int coordinates = 1;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    std::function<double(double)> height, speed, load;
    static void mass(const V1&, V1& m) { m[0] = 1; }
    void force(double t, const V1&, const V1&, V1& f) const { f[0] = load(t); }
    void gaps(double t, const V1& q, V1& g) const { g[0] = q[0] - height(t); }
    static void directions(double, const V1&, V2& h) { h << 1, 0; }
    void surface_rates(double t, const V1&, V2& b) const { b << -speed(t), 0; }
    static double restitution(int) { return 0.5; }
    static double friction(int) { return 0; }
};

TEST(ContactPhases, AStartWhereNothingPressesYetDecidesAsAChange)
{
    const HandOverOptions options{.t_end = 3, .set_valued = {.step = 3e-3}};
    const auto still = [](double) { return 0.0; };
    const auto follow = [&](const OnAPlate& ball) {
        return hand_over(ball, V1(ball.height(0)), V1(ball.speed(0)), options);
    };
    // A plate with the acceleration of free fall at its crest: the ball presses from there on.
    const double w = std::sqrt(10.0);
    const auto rides =
        follow({[w](double t) { return std::cos(w * t); },
                [w](double t) { return -w * std::sin(w * t); }, [](double) { return -10.0; }});
    EXPECT_EQ(rides.outcome, Outcome::reached_end);
    EXPECT_TRUE(rides.events.empty());
    EXPECT_EQ(rides.phases.back().from, 0);
    EXPECT_EQ(rides.phases.back().cause, PhaseCause::held);
    // The position drifts by the error of the trapezium rule, 3e-3^2 w^2 / 12 of the amplitude.
    EXPECT_NEAR(rides.x[0], std::cos(3 * w), 7.5e-6);
    const auto pressed = follow({still, still, [](double t) { return -t; }});
    EXPECT_TRUE(pressed.events.empty());
    EXPECT_EQ(pressed.phases.back().cause, PhaseCause::held);
    EXPECT_EQ(pressed.x[0], 0);
    // A load that lifts it from there on leaves it in flight, as exact as its steps.
    const auto lifted = follow({still, still, [](double t) { return t; }});
    EXPECT_EQ(lifted.phases.size(), 1U);
    EXPECT_NEAR(lifted.x[0], 4.5, 1e-12);
}

TEST(ContactPhases, ABeltCarriesWhatLiesOnIt)
{
    // 2 m/s^2 for 1 s, then its speed.
    const auto run =
        hand_over(Belt{}, {0, 0}, {0, 0},
                  {.t_end = 2, .set_valued = {.step = 1e-2}, .sample_times = {0.5, 1.5}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[2], 2, 1e-10);
    EXPECT_NEAR(run.x[0], 3, 1e-8);
    EXPECT_NEAR(run.forces[0].contacts[1], 2, 1e-9);
    EXPECT_NEAR(run.forces[1].contacts[1], 0, 1e-9);
    EXPECT_NEAR(run.forces[1].contacts[0], 10, 1e-9);
    TimeStepping<Belt> steps(Belt{}, {0, 0}, {0, 0}, {.t_end = 2, .step = 1e-2});
    ASSERT_EQ(steps.run(), Outcome::reached_end);
    EXPECT_NEAR(steps.state().q[0], 3, 1e-8);
}

TEST(ContactPhases, RefusesARateOfASurfaceThatIsNotTheGapsOwn)
{
    const auto start = [](const Shaken& plate) {
        return refusal([&] { (void)hand_over(plate, V1(1), V1(0), {.t_end = 1}); });
    };
    EXPECT_EQ(start({}), "accepted");
    EXPECT_NE(start({.wrong = 0.1}).find("surface_rates"), std::string::npos);
}

// --- dry friction of coordinates ---

/// A body of 1 kg under a load, with dry friction of 2 N; it touches nothing.
struct Slide {
    static constexpr int coordinates = 1;
    static constexpr int contacts = 0;
    static constexpr int tangents = 1;
    double dry = 2;
    double rate = 0;    ///< [N/s] of the load, from 2 s on
    double spring = 0;  ///< [N/m]
    static void mass(const V1&, V1& m) { m << 1; }
    void force(double t, const V1& q, const V1&, V1& f) const
    {
        f << rate * std::max(0.0, t - 2) - spring * q[0];
    }
    [[nodiscard]] double dry_friction(int) const { return dry; }
};

TEST(ContactPhases, DryFrictionStopsACoordinateAndHoldsIt)
{
    // 3 m/s are gone at 1.5 s after 2.25 m, which an event locates. A load of 3 N/s (t - 2) is held
    // until 8/3 s, and then moves the body by 3 s^3 / 6 in s seconds more; the release is known to
    // a step, and costs no more than its order.
    const double h = 1e-3;
    const auto run =
        hand_over(Slide{.rate = 3}, V1(0), V1(3),
                  {.t_end = 4, .set_valued = {.step = h}, .sample_times = {1, 2.5, 3.5}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.phases.size(), 3U);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::held);
    EXPECT_NEAR(run.phases[1].from, 1.5, 1e-12);
    EXPECT_EQ(run.phases[2].cause, PhaseCause::released);
    EXPECT_NEAR(run.phases[2].from, 8.0 / 3, 2 * h);
    EXPECT_NEAR(run.trajectory.x[1][0], 2.25, 1e-9);
    EXPECT_NEAR(run.trajectory.x[1][1], 0, 1e-12);
    EXPECT_EQ(run.forces[0].coordinates[0], 0);              // in flight
    EXPECT_NEAR(run.forces[1].coordinates[0], -1.5, 3 * h);  // the load at the step
    EXPECT_NEAR(run.x[0], 2.25 + 0.5 * std::pow(4 - 8.0 / 3, 3), 10 * h * h);
    EXPECT_TRUE(run.events.empty());
}

TEST(ContactPhases, AnOscillatorWithDryFrictionLosesTheSameInEveryHalfPeriod)
{
    // x'' = -x - 0.1 sgn x' from 1.05: turns at k pi at 1.05 - 0.2 k, and rests at 0.05 after five.
    // At each turn one step is Moreau's, whose error is of second order and third in the position.
    for (const double h : {1e-2, 1e-3}) {
        const auto run = hand_over(Slide{.dry = 0.1, .spring = 1}, V1(1.05), V1(0.0),
                                   {.t_end = 20, .set_valued = {.step = h}});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_NEAR(run.x[0], -0.05, h * h);
        EXPECT_NEAR(run.x[1], 0, 1e-12);
        EXPECT_TRUE(run.phases.back().set_valued);
        EXPECT_NEAR(run.phases.back().from, 5 * M_PI, h);
    }
}

/// A puck whose carriage has friction of its own, 1 N.
struct Guided : Puck {
    static double dry_friction(int i) { return i == 0 ? 1 : 0; }
};

TEST(ContactPhases, DryFrictionActsBesideThatOfAContact)
{
    // 3 m/s^2 on the floor.
    const auto run =
        hand_over(Guided{}, {0, 0}, {3, 0},
                  {.t_end = 2, .set_valued = {.step = 1e-2}, .sample_times = {0.5, 1.5}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 1.5, 1e-8);
    EXPECT_NEAR(run.forces[0].contacts[1], -2, 1e-9);
    EXPECT_NEAR(run.forces[0].coordinates[0], -1, 1e-9);
}

TEST(ContactPhases, RefusesAnImpossibleDryFriction)
{
    EXPECT_THROW((void)hand_over(Slide{.dry = -1}, V1(0), V1(0), {.t_end = 1}),
                 std::invalid_argument);
    EXPECT_THROW((void)hand_over(Slide{.dry = NAN}, V1(0), V1(0), {.t_end = 1}),
                 std::invalid_argument);
}

// --- forces, snapshots, exceptions ---

/// A body on a slope of 0.1, with friction 0.2.
struct OnSlope : Puck {
    static void force(double, const V2&, const V2&, V2& f)
    {
        f << 10 * std::sin(0.1), -10 * std::cos(0.1);
    }
};

TEST(ContactPhases, ForcesOfWhatRestsAreItsWeight)
{
    ContactMotion motion(OnSlope{}, {0, 0}, {0, 0}, {.t_end = 1, .set_valued = {.step = 1e-2}});
    int steps = 0;
    while (motion.step()) {
        ASSERT_TRUE(motion.in_contact());
        if (++steps == 1) continue;  // the impact at the start
        EXPECT_NEAR(motion.forces().contacts[0], 10 * std::cos(0.1), 1e-8);
        EXPECT_NEAR(motion.forces().contacts[1], -10 * std::sin(0.1), 1e-8);
    }
    EXPECT_GT(steps, 90);
}

/// A body on a shaken table, kicked to and fro between two walls, with dry friction of its guide.
struct Busy : Puck {
    static double restitution(int) { return 0.1; }
    static void gaps(double t, const V2& q, V1& g) { g[0] = q[1] - 0.02 * std::sin(30 * t); }
    static void surface_rates(double t, const V2&, V2& b) { b << -0.6 * std::cos(30 * t), 0; }
    static double dry_friction(int i) { return i == 0 ? 0.3 : 0; }
    static constexpr std::size_t guard_count = 2;
    static double guard(std::size_t i, double, const State& x)
    {
        return i == 0 ? 0.3 - x[0] : x[0] + 0.3;
    }
    static void reset(std::size_t, double, State& x) { x[2] = -0.9 * x[2]; }
    static double next_time_event(double t) { return (std::floor(4 * t) + 1) / 4; }
    static void time_reset(double, State& x) { x[2] += 1; }
};

TEST(ContactPhases, ASnapshotGoesOnWithTheSameBitsFromEveryTenthStep)
{
    const auto make = [] {
        return ContactMotion(Busy{}, {0, 0.1}, {1, 0}, {.t_end = 2, .set_valued = {.step = 2e-3}});
    };
    auto whole = make();
    std::vector<Snapshot> saved;
    int steps = 0;
    do {
        if (steps % 10 == 0) saved.push_back(whole.save());
        ++steps;
    } while (whole.step());
    const auto end = whole.finish();
    ASSERT_EQ(end.outcome, Outcome::reached_end);
    ASSERT_GT(whole.phases().size(), 6U);
    ASSERT_GT(saved.size(), 40U);
    for (std::size_t k = 0; k < saved.size(); ++k) {
        auto again = make();
        again.restore(saved[k]);
        const auto run = again.take();
        ASSERT_EQ(run.outcome, end.outcome) << k;
        ASSERT_EQ(run.t, end.t) << k;
        ASSERT_EQ(run.x, end.x) << k;
        const std::size_t events = std::min<std::size_t>(run.events.size(), 5);
        for (std::size_t i = 1; i <= events; ++i) {
            ASSERT_EQ(run.events[run.events.size() - i].t, end.events[end.events.size() - i].t)
                << k;
        }
    }
}

TEST(ContactPhases, ARunGoesOnFromWhereItIsPut)
{
    ContactMotion motion(Puck{}, {0, 0}, {1, 0}, {.t_end = 3, .set_valued = {.step = 1e-2}});
    while (motion.t() < 1) ASSERT_TRUE(motion.step());
    motion.restart(1, {0, 0.2, 1, 0});
    EXPECT_FALSE(motion.in_contact());
    const auto run = motion.take();
    // It falls for 0.2 s, and the impact takes 0.2 times 2 m/s.
    EXPECT_NEAR(run.x[0], 0.2 + 0.6 * 0.6 / 4, 1e-8);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
}

TEST(ContactPhases, AdvanceStopsAtSamplesAndEvents)
{
    ContactMotion motion(Walled{}, {0, 0.2}, {2.5, 0},
                         {.t_end = 2, .set_valued = {.step = 1e-2}, .sample_times = {0.1, 0.3}});
    std::vector<double> at;
    while (motion.advance()) at.push_back(motion.t());
    // Samples, and the impact that follows them; the others are 1e-16 apart.
    ASSERT_GE(at.size(), 3U);
    EXPECT_EQ(at[0], 0.1);
    EXPECT_NEAR(at[1], 0.2, 1e-12);
    EXPECT_NE(std::find(at.begin(), at.end(), 0.3), at.end());
}

/// Its force is not a number around 0.505 s.
struct Gappy : Puck {
    static void force(double t, const V2&, const V2&, V2& f)
    {
        f << 0, std::fabs(t - 0.505) < 1e-6 ? NAN : -10;
    }
};

TEST(ContactPhases, AStepThatIsHalvedIsFollowedByAWholeOne)
{
    // The step from 0.5 s asks for the force at 0.505 s, its half does not: 101 steps.
    const auto run = hand_over(Gappy{}, {0, 0}, {1, 0}, {.t_end = 1, .set_valued = {.step = 1e-2}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.statistics.time_stepping.unsolved, 1U);
    EXPECT_EQ(run.statistics.time_stepping.steps, 101U);
    EXPECT_NEAR(run.x[0], 0.25, 1e-9);
}

/// Its force cannot be had between 0.5 and 0.7 m, for one call.
struct Broken : Puck {
    mutable bool broken = true;
    void force(double, const V2& q, const V2&, V2& f) const
    {
        if (q[0] > 0.5 && std::exchange(broken, false)) throw std::runtime_error("no table");
        f << 0, -10;
    }
};

TEST(ContactPhases, ExceptionsPassAndTheRunGoesOn)
{
    const HandOverOptions options{.t_end = 2, .set_valued = {.step = 1e-2}};
    ContactMotion motion(Broken{}, V2(0, 0), V2(2, 0), options);
    EXPECT_THROW(while (motion.step()), std::runtime_error);
    const auto run = motion.take();
    const auto whole = hand_over(Puck{}, V2(0, 0), V2(2, 0), options);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x, whole.x);
}

TEST(ContactPhases, FixedStepsFlyAndRest)
{
    const auto run = hand_over(Walled{}, {0, 5}, {2.5, 0},
                               {.t_end = 2, .set_valued = {.step = 1e-2}}, FixedStep<Rk4>{});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], -0.5 - 0.5 * 0.5 / 4, 1e-8);
}

}  // namespace
}  // namespace ricochet::contact_phases_test
