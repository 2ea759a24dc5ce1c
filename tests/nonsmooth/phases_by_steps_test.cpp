// Phases of sets without branches, of more than four reactions and of vectors, which implicit steps
// follow; fixed steps; steppers of users.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/stepper/runge_kutta_cash_karp54.hpp>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

#include "phased_runs.hpp"
#include "random_inclusions.hpp"
#include "refusal.hpp"
#include "ricochet/odeint.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::phases_by_steps_test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Implicit steps keep an error of 1e-10 a step. Where the reaction jumps a dozen steps have it in
/// one direction; elsewhere it adds up over some thousand steps.
constexpr double of_steps = 1e-7;

[[nodiscard]] GuardInfo bounding()
{
    GuardInfo info;
    info.unilateral = true;
    return info;
}

/// A body on a plane with friction 1 in all directions, pulled by t/5 along (3, 4); beside it a
/// ball that falls on an elastic floor at g = 1, and a clock.
struct Plane {
    using State = std::array<double, 4>;  // velocities, height and speed of the ball
    struct Motion {
        static constexpr int state_size = 4, reaction_size = 2;
        static void smooth(double t, const Eigen::Vector4d& w, Eigen::Vector4d& f)
        {
            f << 0.6 * t / 5, 0.8 * t / 5, w[3], -1;
        }
        [[nodiscard]] static sets::Ball<2> reaction_set(double, const Eigen::Vector4d&)
        {
            return sets::Ball<2>(1);
        }
    };
    static void flow(double t, const State& x, State& dxdt)
    {
        const double speed = std::hypot(x[0], x[1]);
        dxdt = {0.6 * t / 5 - x[0] / speed, 0.8 * t / 5 - x[1] / speed, x[3], -1};
    }
    [[nodiscard]] static double guard(double, const State& x) { return x[2]; }
    [[nodiscard]] static GuardInfo guard_info() { return bounding(); }
    static void reset(double, State& x) { x[3] = -x[3]; }
    [[nodiscard]] static double next_time_event(double t) { return t < 2.25 ? 2.25 : infinity; }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(PhasesBySteps, ABodySlipsOnAPlaneBesideABall)
{
    // v' = t/5 - 1 along (3, 4) from t = 5: 0.1 at 6. Impacts 1.5, 4.5, apex 1.125 at 3 and 6.
    const auto run = run_of(Plane{}, Plane::State{0, 0, 1.125, 0}, until(6));
    expect_end(run, Plane::State{0.06, 0.08, 1.125, 0}, of_steps);
    expect_times(times_at(run.events, 0, EventKind::crossing), {1.5, 4.5});
    expect_times(times_of(run.events, EventKind::time), {2.25});
    ASSERT_EQ(run.phases.size(), 1U);
    EXPECT_TRUE(run.phases[0].set_valued);
}

TEST(PhasesBySteps, ABodyStopsOnAPlane)
{
    // v' = t/5 - 1 from 0.9: (0.9 - 1 t + t^2/10) is zero at 1, and slips at 5.
    const auto run = run_of(Plane{}, Plane::State{0.54, 0.72, 1.125, 0}, until(3));
    expect_end(run, Plane::State{0, 0, 1.125, 0}, of_steps);
    Options sampled = until(3);
    sampled.sample_times = {0.5};
    const auto half = integrate(Plane{}, Plane::State{0.54, 0.72, 1.125, 0}, sampled);
    EXPECT_NEAR(half.trajectory.x[0][0], 0.6 * 0.425, of_steps);
}

/// The body of `Plane` on two discs, of friction 3/4 and 1/4, with `load` times its pull.
struct TwoDiscs {
    using State = Plane::State;
    struct Motion {
        static constexpr int state_size = 4, reaction_size = 4;
        double load;
        void smooth(double t, const Eigen::Vector4d& w, Eigen::Vector4d& f) const
        {
            f << load * 0.6 * t / 5, load * 0.8 * t / 5, w[3], -1;
        }
        [[nodiscard]] static auto reaction_set(double, const Eigen::Vector4d&)
        {
            return sets::Product(sets::Ball<2>(0.75), sets::Ball<2>(0.25));
        }
        static void observe(Eigen::Matrix4d& e)
        {
            e.setZero();
            e(0, 0) = e(1, 1) = e(2, 0) = e(3, 1) = 1;
        }
    };

    double load;

    void flow(double t, const State& x, State& dxdt) const
    {
        const double speed = std::hypot(x[0], x[1]), pull = load * t / 5;
        dxdt = {0.6 * pull - x[0] / speed, 0.8 * pull - x[1] / speed, x[3], -1};
    }
    [[nodiscard]] static double guard(double, const State& x) { return x[2]; }
    [[nodiscard]] static GuardInfo guard_info() { return bounding(); }
    static void reset(double, State& x) { x[3] = -x[3]; }
    [[nodiscard]] Motion set_valued() const { return {load}; }
};

/// Speed at 6 of the body from 0.9: v' = load t/5 - 1 until it stops, and again from 5 / load.
[[nodiscard]] double speed_at_6(double load)
{
    const double slip = 5 / load;
    return slip < 6 ? load * (36 - slip * slip) / 10 - (6 - slip) : 0;
}

TEST(PhasesBySteps, ABodyOnTwoDiscsStopsAndSlipsAtAnyTolerance)
{
    for (const double rtol : {1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11}) {
        for (const double load : {0.0, 0.3, 1.0, 2.0}) {
            const Options options{.t_end = 6, .rtol = rtol, .atol = rtol};
            const auto run = integrate(TwoDiscs{load}, {0.54, 0.72, 1.125, 0}, options);
            ASSERT_EQ(run.outcome, Outcome::reached_end)
                << rtol << ' ' << load << ' ' << run.reason;
            // Within the tolerance at each of the two changes, where a reaction jumps, and with
            // steps of a thousandth of the run of order two beside them: (6e-3)^2 / 12.
            const double speed = speed_at_6(load), error = 4 * std::min(rtol, 1e-6) + 1e-11;
            EXPECT_NEAR(run.x[0], 0.6 * speed, error) << rtol << ' ' << load;
            EXPECT_NEAR(run.x[1], 0.8 * speed, error) << rtol << ' ' << load;
            EXPECT_LT(run.statistics.steps, 1100U) << rtol << ' ' << load;
            expect_times(times_at(run.events, 0, EventKind::crossing), {1.5, 4.5});
        }
    }
}

TEST(PhasesBySteps, ABodyOnTwoDiscsGoesThroughSnapshots)
{
    const auto run = run_of(TwoDiscs{1}, TwoDiscs::State{0.54, 0.72, 1.125, 0}, until(6));
    expect_end(run, TwoDiscs::State{0.06, 0.08, 1.125, 0}, of_steps);
}

/// A body on one disc of friction 1, and the ball of `Plane` beside it.
struct Pulled {
    struct Motion {
        static constexpr int state_size = 4, reaction_size = 2;
        Eigen::Vector2d steady, growing;
        void smooth(double t, const Eigen::Vector4d& w, Eigen::Vector4d& f) const
        {
            f << steady + t * growing, w[3], -1;
        }
        [[nodiscard]] static sets::Ball<2> reaction_set(double, const Eigen::Vector4d&)
        {
            return sets::Ball<2>(1);
        }
    };
    using State = std::array<double, 4>;
    Motion motion;
    void flow(double t, const State& x, State& dxdt) const
    {
        const double speed = std::hypot(x[0], x[1]);
        const Eigen::Vector2d pull = motion.steady + t * motion.growing;
        dxdt = {pull[0] - x[0] / speed, pull[1] - x[1] / speed, x[3], -1};
    }
    [[nodiscard]] static double guard(double, const State& x) { return x[2]; }
    [[nodiscard]] static GuardInfo guard_info() { return bounding(); }
    static void reset(double, State& x) { x[3] = -x[3]; }
    [[nodiscard]] Motion set_valued() const { return motion; }
};

/// Random pulls in random directions on one disc, beside a ball: a run to 1e-10 agrees with one to
/// 1e-8 within the latter.
TEST(PhasesBySteps, DiscsUnderRandomLoadsStopAtSmallTolerances)
{
    test::Draw draw(5);
    for (int k = 0; k < 40; ++k) {
        Pulled system;
        system.motion.steady = {draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5)};
        system.motion.growing = {draw.uniform(-0.2, 0.2), draw.uniform(-0.2, 0.2)};
        const Pulled::State from{draw.uniform(-1, 1), draw.uniform(-1, 1), 1.125, 0};
        Pulled::State coarse{};
        for (const double rtol : {1e-8, 1e-10}) {
            const auto run = integrate(system, from, {.t_end = 6, .rtol = rtol, .atol = rtol});
            ASSERT_EQ(run.outcome, Outcome::reached_end) << k << ' ' << rtol << ' ' << run.reason;
            EXPECT_LT(run.statistics.steps, 4000U) << k << ' ' << rtol;
            if (rtol == 1e-8) coarse = run.x;
            // A hundred steps may spend their tolerance in one direction.
            for (int i = 0; i < 2; ++i) EXPECT_NEAR(run.x[i], coarse[i], 1e-6) << k;
        }
    }
}

TEST(PhasesBySteps, ARunStopsAtAnEventBesideASetWithoutBranches)
{
    Options options = until(6);
    options.stop_at_event = true;
    const auto run = integrate(Plane{}, Plane::State{0, 0, 1.125, 0}, options);
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 1.5, exact_motion);
}

/// Blocks with friction 1, as many as there are, which a load of 1.5 pulls from 2 s on; the last
/// two components are the ball of `Plane`.
struct Blocks {
    using State = std::vector<double>;

    std::size_t count;

    struct Friction {
        std::size_t count;
        [[nodiscard]] std::size_t dimension() const { return count; }
        [[nodiscard]] static double lower(std::size_t) { return -1; }
        [[nodiscard]] static double upper(std::size_t) { return 1; }
        void project(std::span<const double> z, std::span<double> p) const
        {
            detail::clamp(*this, z, p);
        }
        void derivative(std::span<const double> z, std::span<double> d) const
        {
            detail::clamp_derivative(*this, z, d);
        }
    };
    struct Motion {
        static constexpr int state_size = Eigen::Dynamic, reaction_size = Eigen::Dynamic;
        int blocks;
        [[nodiscard]] int size() const { return blocks + 2; }
        [[nodiscard]] int reactions() const { return blocks; }
        void smooth(double t, const Eigen::VectorXd& w, Eigen::VectorXd& f) const
        {
            f.setConstant(size(), load(t));
            f[blocks] = w[blocks + 1];
            f[blocks + 1] = -1;
        }
        [[nodiscard]] Friction reaction_set(double, const Eigen::VectorXd&) const
        {
            return {static_cast<std::size_t>(blocks)};
        }
    };

    [[nodiscard]] static double load(double t) { return t < 2 ? 0 : 1.5; }
    void flow(double t, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < count; ++i) dxdt[i] = load(t) - (x[i] >= 0 ? 1 : -1);
        dxdt[count] = x[count + 1];
        dxdt[count + 1] = -1;
    }
    [[nodiscard]] double guard(double, const State& x) const { return x[count]; }
    [[nodiscard]] static GuardInfo guard_info() { return bounding(); }
    void reset(double, State& x) const { x[count + 1] = -x[count + 1]; }
    [[nodiscard]] static double next_time_event(double t) { return t < 2 ? 2 : infinity; }
    [[nodiscard]] Motion set_valued() const { return {static_cast<int>(count)}; }
};

TEST(PhasesBySteps, MoreThanFourBlocksStopAndSlip)
{
    // Block i stops at its speed; all have 0.5 at 3.
    constexpr std::size_t count = 6;
    Blocks::State x0(count + 2);
    for (std::size_t i = 0; i < count; ++i) x0[i] = 0.1 * static_cast<double>(i + 1);
    x0[count] = 1.125;
    const Blocks blocks{count};
    const auto run = run_of(blocks, x0, until(3));
    Blocks::State expected(count + 2, 0.5);
    expected[count] = 1.125;
    expected[count + 1] = 0;
    expect_end(run, expected, of_steps);
    expect_times(times_at(run.events, 0, EventKind::crossing), {1.5});
    EXPECT_FALSE(run.phases[0].set_valued);  // its own flow, while all blocks slide

    Options sampled = until(3);
    sampled.sample_times = {0.35, 1.9};
    const auto shown = integrate(blocks, x0, sampled);
    EXPECT_NEAR(shown.trajectory.x[0][3], 0.05, of_steps);
    EXPECT_NEAR(shown.trajectory.x[0][2], 0, of_steps);
    EXPECT_NEAR(shown.trajectory.x[1][5], 0, of_steps);
}

TEST(PhasesBySteps, AnInclusionOfAnotherSizeIsRefused)
{
    EXPECT_EQ(refusal([] {
                  (void)integrate(Blocks{3}, Blocks::State{1, 1, 1, 1.125}, until(1));
              }),
              "integrate: the inclusion of set_valued has 5 components, the state 4; expected as "
              "many");
}

/// A current that an integrator saturates at 1, under the load 2 - t.
struct Saturated {
    using State = std::array<double, 1>;
    struct Motion {
        static constexpr int state_size = 1, reaction_size = 1;
        static constexpr Confines confines = Confines::state;
        using Vector = Eigen::Matrix<double, 1, 1>;
        static void smooth(double t, const Vector&, Vector& f) { f[0] = 2 - t; }
        static sets::IntervalSet reaction_set(double, const Vector&)
        {
            return sets::IntervalSet::symmetric(1);
        }
    };
    static void flow(double t, const State&, State& dxdt) { dxdt[0] = 2 - t; }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(PhasesBySteps, AStopHoldsAStateUntilItsLoadTurns)
{
    // It is at 1 from 2 - sqrt 2 on, and leaves at 2: x(3) = 1/2.
    const auto run = run_of(Saturated{}, Saturated::State{0}, until(3));
    expect_end(run, Saturated::State{0.5}, of_steps);
}

TEST(PhasesBySteps, ALeastStepThatIsTooLongForTheToleranceEndsTheRun)
{
    // Where the body slips its acceleration has a kink: 1e-3 s across it leave an error of some
    // 1e-8.
    Options options = until(6);
    options.h_min = 1e-3;
    const auto run = integrate(Plane{}, Plane::State{0, 0, 1.125, 0}, options);
    EXPECT_EQ(run.outcome, Outcome::step_underflow);
}

// --- fixed steps ---

/// A block that slides, and beside it a ball with this restitution.
[[nodiscard]] Slider<3> block_and_ball(double restitution, bool throws = false)
{
    using X = Slider<3>::State;
    GuardInfo floor = bounding();
    return {.f =
                [throws](double t, const X& x, X& dxdt) {
                    if (throws && t > 1.2) throw std::invalid_argument("table ends at 1.2 s");
                    dxdt = {0, x[2], -1};
                },
            .own = {{floor, [](double, const X& x) { return x[1]; },
                     [restitution](double, X& x) { x[2] = -restitution * x[2]; }}}};
}

template <class System, class X>
[[nodiscard]] auto fixed_run(const System& system, const X& x0, Options options)
{
    options.step = 0.01;
    return integrate(system, x0, options, FixedStep<Rk4>{});
}

TEST(PhasesBySteps, FixedStepsFollowABlockThatStopsBesideABall)
{
    const auto run = fixed_run(block_and_ball(1), Slider<3>::State{1, 1.125, 0}, {.t_end = 3});
    expect_end(run, Slider<3>::State{0, 1.125, 0});
    expect_times(times_of(run.events, EventKind::stick), {1});
    expect_times(times_at(run.events, 1, EventKind::crossing), {1.5});
}

TEST(PhasesBySteps, FixedStepsStopAtAnEventAndAfterSeveral)
{
    Slider<3> system = block_and_ball(1);
    system.own[0].info.stop_after = 2;
    const auto run = fixed_run(system, Slider<3>::State{1, 1.125, 0}, {.t_end = 9});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 4.5, exact_motion);
    const auto first =
        fixed_run(system, Slider<3>::State{1, 1.125, 0}, {.t_end = 9, .stop_at_event = true});
    EXPECT_EQ(first.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(first.t, 1, exact_motion);
}

TEST(PhasesBySteps, AnExceptionPassesThroughFixedSteps)
{
    // It is thrown where the block has stopped, at 1 s, and the inclusion is followed.
    EXPECT_EQ(
        refusal([&] {
            (void)fixed_run(block_and_ball(0.5, true), Slider<3>::State{1, 1.125, 0}, {.t_end = 3});
        }),
        "table ends at 1.2 s");
}

TEST(PhasesBySteps, AnAccumulationThatNoReactionEndsEndsARunOfFixedSteps)
{
    // The bounces end at 4.5, long before the block stops at 10.
    const auto run = fixed_run(block_and_ball(0.5), Slider<3>::State{10, 1.125, 0}, {.t_end = 6});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.guard, 1U);
    EXPECT_NEAR(run.t, 4.5, 1e-6);
}

TEST(PhasesBySteps, FixedImplicitStepsHaveTheGivenLength)
{
    // It slips at 4: v(6) = 2. The step in which it slips is not cut, and misses the load of at
    // most its own length twice: 0.01^2.
    const auto run = fixed_run(TwoContactsOnBelts{}, TwoContacts::State{0}, {.t_end = 6});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 2, 1e-4);
    EXPECT_NEAR(static_cast<double>(run.set_valued.accepted), 400, 20);
    EXPECT_GT(run.statistics.steps, run.set_valued.accepted);
}

/// The same by steps, with a new simulation after every tenth.
template <class System, class X>
[[nodiscard]] X fixed_end_by_snapshots(const System& system, const X& x0, Options options)
{
    options.step = 0.01;
    const auto start = [&] {
        return std::make_unique<Simulation<System, X, FixedStep<Rk4>>>(system, x0, options,
                                                                       FixedStep<Rk4>{});
    };
    auto simulation = start();
    for (int steps = 1; simulation->step(); ++steps) {
        if (steps % 10 != 0) continue;
        const Snapshot saved = simulation->save();
        simulation = start();
        simulation->restore(saved);
    }
    return simulation->x();
}

TEST(PhasesBySteps, FixedStepsStopBlocksBetweenTheirEnds)
{
    // As above, with stops inside of steps, and before the load begins.
    constexpr std::size_t count = 6;
    Blocks::State x0(count + 2);
    for (std::size_t i = 0; i < count; ++i) x0[i] = 0.0977 * static_cast<double>(i + 1);
    x0[count] = 1.125;
    const Blocks blocks{count};
    Options options{.t_end = 1.9};
    options.sample_times = {0.35, 1.9};
    const auto run = fixed_run(blocks, x0, options);
    Blocks::State expected(count + 2, 0);
    expected[count] = 1.5 * 0.4 - 0.4 * 0.4 / 2;  // the ball, from 1.5 on upwards with 1.5
    expected[count + 1] = 1.1;
    expect_end(run, expected);
    EXPECT_FALSE(run.phases[0].set_valued);
    ASSERT_EQ(run.trajectory.x.size(), 2U);
    for (std::size_t i = 0; i < count; ++i) {
        EXPECT_NEAR(run.trajectory.x[0][i], std::max(x0[i] - 0.35, 0.0), exact_motion) << i;
        EXPECT_NEAR(run.trajectory.x[1][i], 0, 1e-12) << i;
    }
    EXPECT_EQ(fixed_end_by_snapshots(blocks, x0, options), run.x);
}

TEST(PhasesBySteps, FixedStepsStopADiscAndLetItSlip)
{
    // Along (3, 4): v = 0.9 - t + t^2 / 10 until 1, rest until the load is 1 at 5, (t - 5)^2 / 10.
    // Steps of 0.01 do not meet the slip from 0.003 on; the one across it misses its own length of
    // the load twice, and the one across the stop that of the speed.
    for (const double from : {0.0, 0.003}) {
        Options options{.t_start = from, .t_end = 6};
        const double v = 0.9 - from + from * from / 10;
        const Plane::State x0{0.6 * v, 0.8 * v, 1.125 - from * from / 2, -from};
        const auto run = fixed_run(Plane{}, x0, options);
        expect_end(run, Plane::State{0.06, 0.08, 1.125, 0}, 1e-4);
        expect_times(times_at(run.events, 0, EventKind::crossing), {1.5, 4.5});
        options.t_end = 4.9;
        const auto held = fixed_run(Plane{}, x0, options);
        EXPECT_LT(std::hypot(held.x[0], held.x[1]), 1e-9);
        EXPECT_EQ(fixed_end_by_snapshots(Plane{}, x0, options), held.x);
    }
}

// --- other methods ---

using OdeintsCashKarp = ErrorControlled<Odeint<boost::numeric::odeint::runge_kutta_cash_karp54>>;

TEST(PhasesBySteps, AStepperOfOdeintFollowsTheFlowBesideAnInclusion)
{
    const Slider<3>::State x0{1, 1.125, 0};
    const auto run = integrate(block_and_ball(1), x0, until(3), OdeintsCashKarp{});
    expect_end(run, Slider<3>::State{0, 1.125, 0});
    expect_times(times_of(run.events, EventKind::stick), {1});
}

/// The block and the ball, with a flow that Taylor series can be made of.
struct Analytic {
    using State = std::array<double, 3>;
    static constexpr std::size_t mode_count = 2;  // it slides forward or backward

    struct Motion {
        static constexpr int state_size = 3, reaction_size = 1;
        static void smooth(double, const Eigen::Vector3d& w, Eigen::Vector3d& f)
        {
            f << 0, w[2], -1;
        }
        [[nodiscard]] static sets::IntervalSet reaction_set(double, const Eigen::Vector3d&)
        {
            return sets::IntervalSet::symmetric(1);
        }
    };
    template <class S>
    constexpr void flow(Mode mode, const S& /*t*/, const std::array<S, 3>& x,
                        std::array<S, 3>& dxdt) const
    {
        dxdt[0] = S(mode == 0 ? -1.0 : 1.0);
        dxdt[1] = x[2];
        dxdt[2] = S(-1.0);
    }
    [[nodiscard]] static double guard(Mode, double, const State& x) { return x[1]; }
    [[nodiscard]] static GuardInfo guard_info() { return bounding(); }
    [[nodiscard]] static Mode reset(Mode mode, double, State& x)
    {
        x[2] = -x[2];
        return mode;
    }
    [[nodiscard]] static Mode start_mode(double, const State& x) { return x[0] >= 0 ? 0 : 1; }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(PhasesBySteps, TaylorSeriesFollowTheFlowBesideAnInclusion)
{
    const auto run =
        integrate(Analytic{}, Analytic::State{1, 1.125, 0}, until(3), ErrorControlled<Taylor>{});
    expect_end(run, Analytic::State{0, 1.125, 0});
    expect_times(times_of(run.events, EventKind::stick), {1});
}

/// A disc that rubs on a plane, without a load once it rests, beside a component of its own rate.
struct DiscBeside {
    static constexpr int state_size = 3, reaction_size = 2;
    double rate = 0;

    void smooth(double, const Eigen::Vector3d&, Eigen::Vector3d& f) const { f << 0, 0, rate; }
    static void observe(Eigen::Matrix<double, 2, 3>& e) { e << 1, 0, 0, 0, 1, 0; }
    [[nodiscard]] static sets::Ball<2> reaction_set(double, const Eigen::Vector3d&)
    {
        return sets::Ball<2>(1);
    }
};

TEST(PhasesBySteps, ADiscAtRestBreaksNoLawWhateverMovesBesideIt)
{
    for (const double rate : {0.0, -1e-3, -1.0, -10.0}) {
        for (const double speed : {0.1, 0.2, 0.5, 1.0, 2.0}) {
            const auto run = hand_over(DiscBeside{rate},
                                       Eigen::Vector3d(0.6 * speed, 0.8 * speed, 0), {.t_end = 9});
            EXPECT_EQ(run.outcome, Outcome::reached_end) << rate << " " << speed;
            // It stops after `speed` seconds, and rests up to the solver's 1e-10.
            EXPECT_LT(run.x.head<2>().norm(), 1e-9);
        }
    }
}

}  // namespace
}  // namespace ricochet::phases_by_steps_test
