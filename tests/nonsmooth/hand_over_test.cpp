// The hand-over between events and Bathe's steps: changes of mode, rest, release, bad input.

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <numbers>
#include <string>

#include "piecewise_linear.hpp"
#include "problems/incline_block.hpp"
#include "problems/rolling_ball.hpp"
#include "problems/super_twisting.hpp"
#include "refusal.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "ricochet/systems/stick_slip.hpp"

namespace ricochet::hand_over_test {
namespace {

using namespace sets;

using testing_support::ExactCircuit;
using One = Eigen::Matrix<double, 1, 1>;

One one(double value)
{
    return One::Constant(value);
}

template <class System>
Branch branch_after(const Event<StateOf<System>>& event)
{
    return BranchModes<System>::branch(event.guard, event.mode_after);
}

// --- modes ---

/// A is full, and y is not a component of the state.
struct Coupled {
    static constexpr int state_size = 3;
    static constexpr int reaction_size = 1;
    using Vector = Eigen::Vector3d;

    static Eigen::Matrix3d a() { return Eigen::Matrix3d{{2, 0.5, 0}, {0.5, 3, -1}, {0, -1, 4}}; }
    static Eigen::RowVector3d e() { return {1, -0.5, 2}; }
    static Vector f(double t, const Vector& w) { return {w[1] - t, w[2] * w[0], 1 - w[1]}; }

    void smooth(double t, const Vector& w, Vector& out) const { out = f(t, w); }
    void mass(Eigen::Matrix3d& out) const { out = a(); }
    void observe(Eigen::RowVector3d& out) const { out = e(); }
    [[nodiscard]] IntervalSet reaction_set(double /*t*/, const Vector& /*w*/) const
    {
        return {-0.75, 0.5};
    }
};

TEST(BranchModes, FlowIsThatOfTheMatricesOfAMode)
{
    // Sums of a dozen terms of the order of 1, in different orders.
    const double rounding = 1e-14;
    const BranchModes<Coupled> modes{Coupled{}};
    const double t = 0.3;
    const Coupled::Vector w(0.4, -1.25, 2);
    const auto flow_of = [&](Mode mode) {
        std::array<double, 3> rate{};
        modes.flow(mode, t, {w[0], w[1], w[2]}, rate);
        return Coupled::Vector(rate[0], rate[1], rate[2]);
    };
    const Eigen::Matrix3d inverse = Coupled::a().inverse();
    const auto with = [&](double reaction) -> Coupled::Vector {
        return inverse * (Coupled::f(t, w) + reaction * Coupled::e().transpose());
    };

    EXPECT_LT((flow_of(0) - with(-0.75)).norm(), rounding);
    EXPECT_LT((flow_of(2) - with(0.5)).norm(), rounding);
    const double lever = Coupled::e() * inverse * Coupled::e().transpose();
    const double held = -(Coupled::e() * inverse * Coupled::f(t, w)).value() / lever;
    EXPECT_LT((flow_of(1) - with(held)).norm(), rounding);
    EXPECT_LT(std::abs(Coupled::e() * flow_of(1)), rounding);
    EXPECT_EQ(flow_of(BranchModes<Coupled>::several), Coupled::Vector::Zero());
}

// --- sliding mode ---

void reach_zero(const SlidingMode& system, double from, double exact_time)
{
    // The right-hand side is a quadrature; Dormand and Prince's error at rtol 1e-12 is far below
    // the tolerance, and w meets zero at a rate of 0.2 or more.
    const auto run = hand_over(system, one(from),
                               {.t_end = 0.5,
                                .rtol = 1e-12,
                                .atol = 1e-13,
                                .sample_times = {0.05, exact_time + 1e-9, 0.3, 0.5}});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].kind, EventKind::stick);
    EXPECT_NEAR(run.events[0].t, exact_time, 1e-12);
    EXPECT_NEAR(run.trajectory.x[0][0], system.exact(0.05, from), 1e-12);
    for (std::size_t i = 1; i < 4; ++i) EXPECT_EQ(run.trajectory.x[i][0], 0.0);
    EXPECT_EQ(run.t, 0.5);
    EXPECT_EQ(run.x[0], 0.0);
    const auto& p = system.parameters();
    EXPECT_NEAR(run.reaction[0], -p.amplitude * std::sin(p.frequency * 0.5), 1e-13);
}

/// k t_end / n, k = 0 ... n.
std::vector<double> evenly(double t_end, int n)
{
    std::vector<double> t;
    for (int k = 0; k <= n; ++k) t.push_back(t_end * k / n);
    return t;
}

TEST(HandOver, ErrorsOverTheWholeMotionFollowTheTolerance)
{
    // The root of the mean square over the motion; relative for the circuit.
    const SlidingMode sliding;
    const auto t = evenly(0.5, 5000);
    const auto loose = hand_over(sliding, one(0.15),
                                 {.t_end = 0.5, .rtol = 1e-4, .atol = 1e-4, .sample_times = t});
    double square = 0;
    for (std::size_t i = 0; i < t.size(); ++i) {
        square += std::pow(loose.trajectory.x[i][0] - sliding.exact(t[i], 0.15), 2);
    }
    EXPECT_LE(std::sqrt(0.5 * square / 5000), 1.7e-4);

    ExactCircuit exact;
    exact.run(DiodeCircuit::start(), 20);
    const auto times = evenly(20, 4000);
    const auto run = hand_over(DiodeCircuit{}, DiodeCircuit::start(),
                               {.t_end = 20, .rtol = 3e-8, .atol = 3e-8, .sample_times = times},
                               ErrorControlled<Fehlberg78>{});
    double error = 0;
    double size = 0;
    for (std::size_t i = 0; i < times.size(); ++i) {
        const Eigen::Vector3d state = exact.state(times[i]);
        error += (run.trajectory.x[i] - state).squaredNorm();
        size += state.squaredNorm();
    }
    EXPECT_LE(std::sqrt(error / size), 1e-8);
}

TEST(HandOver, SlidingModeReachesZeroInTimeAndStaysThereToTheBit)
{
    reach_zero(SlidingMode{}, 0.15, 0.093315472931294579027);
    reach_zero(SlidingMode({.amplitude = 1.5}), 0.1, 0.076589082534055237469);
}

// --- diode circuit ---

void follow(const Eigen::Vector3d& start, double t_end, std::size_t changes)
{
    ExactCircuit exact;
    exact.run(start, t_end);
    ASSERT_EQ(exact.changes.size(), changes);

    const auto run =
        hand_over(DiodeCircuit{}, start, {.t_end = t_end, .rtol = 1e-12, .atol = 1e-12},
                  ErrorControlled<Fehlberg78>{});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), changes);
    int before = start[0] > 0 ? 1 : -1;
    for (std::size_t i = 0; i < changes; ++i) {
        const auto& event = run.events[i];
        const auto& [t, sign] = exact.changes[i];
        // Errors of some 300 steps within 1e-12 of a motion of size 10.
        EXPECT_NEAR(event.t, t, 1e-9) << "change " << i;
        EXPECT_EQ(-static_cast<int>(branch_after<DiodeCircuit>(event)), sign) << "change " << i;
        EXPECT_EQ(event.kind, before == 0 ? EventKind::slip
                              : sign == 0 ? EventKind::stick
                                          : EventKind::mode);
        before = sign;
    }
    EXPECT_LE((run.x - exact.final).norm(), 1e-10);
    EXPECT_EQ(run.x[0], 0.0);
    EXPECT_EQ(run.phases.size(), 1u);
}

TEST(HandOver, DiodeCircuitChangesItsModeTwelveTimes)
{
    follow(DiodeCircuit::start(), 20, 12);
}

TEST(HandOver, DiodeCircuitOfTheTrainingCaseSticksOnce)
{
    follow({0.15264, -0.02281, 0.38127}, 10, 1);
}

// --- friction ---

TEST(HandOver, CoulombOscillatorTurnsAndRests)
{
    const CoulombOscillator closed;
    const auto run = hand_over(FrictionInclusion({.law = FrictionLaw::constant}),
                               Eigen::Vector2d(2, 0), {.t_end = 12, .rtol = 1e-12, .atol = 1e-13});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 3u);
    for (int n = 1; n <= 3; ++n) {
        const auto& event = run.events[static_cast<std::size_t>(n - 1)];
        EXPECT_NEAR(event.t, closed.turning_time(n), 1e-10);
        EXPECT_NEAR(event.before[0], closed.turning_point(n), 1e-10);
        EXPECT_EQ(event.kind, n < 3 ? EventKind::mode : EventKind::stick);
    }
    EXPECT_EQ(run.x[1], 0.0);
    // The friction balances the spring, u + r = 0.
    EXPECT_NEAR(run.reaction[0], -0.2, 1e-10);
}

TEST(HandOver, StickSlipStartsAtTheOnsetOfSlipAndRepeats)
{
    const auto run =
        hand_over(FrictionInclusion({.belt_speed = 0.2, .friction = 1, .weakening = 3}),
                  Eigen::Vector2d(1, 0.2), {.t_end = 25, .rtol = 1e-12, .atol = 1e-13});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 4u);
    const EventKind kinds[] = {EventKind::stick, EventKind::slip, EventKind::stick,
                               EventKind::slip};
    const double times[] = {StickSlip::stick_time, StickSlip::period,
                            StickSlip::period + StickSlip::stick_time, 2 * StickSlip::period};
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(run.events[i].kind, kinds[i]);
        EXPECT_NEAR(run.events[i].t, times[i], 1e-9);
    }
    EXPECT_NEAR(run.events[0].before[0], StickSlip::stick_position, 1e-10);
}

TEST(HandOver, EveryLawOfFrictionSticksAndSlips)
{
    for (const FrictionLaw law :
         {FrictionLaw::hyperbolic, FrictionLaw::exponential, FrictionLaw::humped}) {
        const FrictionInclusion system(
            {.belt_speed = 0.2, .friction = 1, .weakening = 1, .residual = 0.5, .law = law});
        const auto run = hand_over(system, Eigen::Vector2d(0, 0.2), {.t_end = 40});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        ASSERT_GE(run.events.size(), 4u);
        // Slip begins where the spring meets the friction at rest.
        EXPECT_EQ(run.events[0].kind, EventKind::slip);
        EXPECT_NEAR(run.events[0].before[0], 1, 1e-9);
        EXPECT_NEAR(run.events[0].t, 5, 1e-8);
    }
}

// --- several reactions ---

TEST(HandOver, BallSlidesRollsAndRestsOnThePlate)
{
    const RollingBall ball;
    const double faster = 0.8;
    const double plate = ball.parameters().plate_speed;
    const auto run = hand_over(ball, Eigen::Vector2d(plate + faster, 0), {.t_end = 6});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 2u);
    // The motion is linear in time: the only error is rounding.
    EXPECT_EQ(run.events[0].kind, EventKind::stick);
    EXPECT_EQ(run.events[0].guard, 0u);
    EXPECT_NEAR(run.events[0].t, ball.rolling_time(faster), 1e-12);
    EXPECT_EQ(run.events[1].kind, EventKind::stick);
    EXPECT_EQ(run.events[1].guard, 1u);
    EXPECT_NEAR(run.events[1].t, ball.rest_time(faster), 1e-12);
    EXPECT_NEAR(run.x[0], plate, 1e-15);
    EXPECT_EQ(run.x[1], 0.0);
}

TEST(HandOver, BallIsShakenOffItsRest)
{
    // It rests while |s'| = speed frequency sin <= resistance g / radius.
    const RollingBall ball({.plate_speed = 0.5, .plate_frequency = 1});
    const double limit = 0.001 * 9.81 / 0.05;
    const auto run = hand_over(ball, Eigen::Vector2d(0.5, 0), {.t_end = 1});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].kind, EventKind::slip);
    EXPECT_EQ(run.events[0].guard, 1u);
    EXPECT_NEAR(run.events[0].t, std::asin(limit / 0.5), 1e-9);
    // Rolling without slipping from there: with |M| = resistance m g against the spin,
    // 7/5 v' = 2/5 s' + resistance g / radius, which is integrated in closed form.
    const double t0 = std::asin(limit / 0.5);
    const double v =
        0.5 * std::cos(t0) + (0.4 * 0.5 * (std::cos(1) - std::cos(t0)) - limit * (1 - t0)) / 1.4;
    EXPECT_NEAR(run.x[0], v, 1e-8);
}

/// Two relays on one force: if both release together, the rates do not determine what follows.
struct TwinRelays {
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 2;
    static constexpr bool affine = true;
    void smooth(double t, const Eigen::Vector2d&, Eigen::Vector2d& f) const { f.setConstant(t); }
    void smooth_jacobian(double, const Eigen::Vector2d&, Eigen::Matrix2d& j) const { j.setZero(); }
    static Box<2> reaction_set(double, const Eigen::Vector2d&) { return Box<2>({-1, -1}, {1, 1}); }
};

TEST(HandOver, ChangesThatCoincideGoThroughStepsAndBack)
{
    // Both are held until t = 1, then w' = t - 1.
    const auto run = hand_over(TwinRelays{}, Eigen::Vector2d(0, 0), {.t_end = 3});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_GE(run.phases.size(), 3u);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::several);
    EXPECT_TRUE(run.phases[1].set_valued);
    EXPECT_NEAR(run.phases[1].from, 1, 1e-12);
    EXPECT_EQ(run.phases.back().cause, PhaseCause::released);
    EXPECT_FALSE(run.phases.back().set_valued);
    // The steps between have lengths of 3e-3, and there are few of them.
    EXPECT_LE(run.set_valued.accepted, 20u);
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(run.x[i], 2, 1e-4);
    EXPECT_EQ(run.reaction[0], -1.0);
}

// --- accumulation, no modes ---

TEST(HandOver, TwistingAccumulatesAndIsHeldBySteps)
{
    const SuperTwisting system;
    const auto run = hand_over(system, Eigen::Vector2d(1, 0), {.t_end = 10});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.phases.size(), 2u);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::accumulation);
    // Held at zero, the relay balances the rate of the disturbance, cos t.
    EXPECT_LE(run.x.norm(), 1e-9);
    EXPECT_NEAR(run.reaction[0], -std::cos(10.0), 1e-6);
    EXPECT_TRUE(run.phases[1].set_valued);
}

TEST(HandOver, ABallOfReactionsIsFollowedBySteps)
{
    const InclineBlock system;
    const auto& p = system.parameters();
    const auto run = hand_over(system, Eigen::Vector4d(1, 0, 0, 0), {.t_end = 2});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.phases.size(), 1u);
    EXPECT_EQ(run.phases[0].cause, PhaseCause::no_modes);
    // Straight down the slope it stops after v^2 / (2 a); the step across the stop is of
    // order one, 2e-3 s of 1 m/s.
    const double deceleration = p.gravity * (p.friction * std::cos(p.slope) - std::sin(p.slope));
    EXPECT_NEAR(run.x[2], 1 / (2 * deceleration), 1e-4);
    EXPECT_NEAR(run.x[0], 0, 1e-12);
}

// --- the reaction is part of the state ---

TEST(HandOver, GoesOnFromASavedStateWithItsReaction)
{
    const InclineBlock system;
    const Eigen::Vector4d start(1, 0.5, 0, 0);
    const auto options = [](double from, double to) {
        HandOverOptions out{.t_start = from, .t_end = to};
        out.set_valued.step = 0x1p-9;  // so that the steps coincide
        return out;
    };
    const auto whole = hand_over(system, start, options(0, 1));
    const auto half = hand_over(system, start, options(0, 0.25));
    const auto rest = HandOver<InclineBlock>(system, half, options(0.25, 1)).take();

    EXPECT_NE(half.reaction[0], 0.0);
    EXPECT_EQ(rest.x, whole.x);
    EXPECT_EQ(rest.reaction, whole.reaction);

    auto wrong = half;
    for (double& r : wrong.reaction) r *= 2;
    EXPECT_THROW(HandOver<InclineBlock>(system, wrong, options(0.25, 1)), std::invalid_argument);
}

TEST(HandOver, EventDrivenRunsGoOnFromTheirEnd)
{
    ExactCircuit exact;
    exact.run(DiodeCircuit::start(), 20);
    // 1.5 s: held at zero.
    const HandOverOptions first{.t_end = 1.5, .rtol = 1e-12, .atol = 1e-12};
    const auto half = hand_over(DiodeCircuit{}, DiodeCircuit::start(), first);
    ASSERT_EQ(half.x[0], 0.0);
    const HandOverOptions second{.t_end = 20, .rtol = 1e-12, .atol = 1e-12};
    const auto rest = HandOver<DiodeCircuit>(DiodeCircuit{}, half, second).take();
    EXPECT_EQ(half.events.size() + rest.events.size(), 12u);
    EXPECT_LE((rest.x - exact.final).norm(), 1e-10);
}

// --- infinite bounds, sets that become empty ---

/// w' = force + r with any set.
template <class Set>
struct Pushed {
    static constexpr int state_size = 1;
    static constexpr int reaction_size = 1;
    double force = 0;
    Set set;
    void smooth(double, const One&, One& f) const { f[0] = force; }
    IntervalSet reaction_set(double t, const One&) const { return set(t); }
};

template <class Set>
Pushed<Set> pushed(double force, const Set& set)
{
    return {force, set};
}

TEST(HandOver, AHalfLineHoldsToTheEnd)
{
    const auto system = pushed(-1, [](double) { return IntervalSet::half_line(); });
    const auto run = hand_over(system, one(1), {.t_end = 3});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].kind, EventKind::stick);
    EXPECT_NEAR(run.events[0].t, 1, 1e-12);
    EXPECT_EQ(run.x[0], 0);
    EXPECT_NEAR(run.reaction[0], 1, 1e-15);
    EXPECT_EQ(run.phases.size(), 1u);
}

TEST(HandOver, AReactionWithoutBoundsHoldsInOnePhase)
{
    const double infinity = std::numeric_limits<double>::infinity();
    const auto system = pushed(-5, [=](double) { return IntervalSet::symmetric(infinity); });
    const auto run = hand_over(system, one(0), {.t_end = 3});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x[0], 0);
    EXPECT_NEAR(run.reaction[0], 5, 1e-14);
    EXPECT_EQ(run.phases.size(), 1u);
}

template <class Set>
void expect_empty_at_one_half(double start, const Set& set)
{
    const auto run = hand_over(pushed(0.1, set), one(start), {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::not_converged);
    // Steps of 1e-3 end within one of the time, events where the set changes.
    EXPECT_NEAR(run.t, 0.5, 2e-3);
    EXPECT_EQ(run.failure.set, 0);
}

TEST(HandOver, ASetThatBecomesEmptyEndsTheRun)
{
    for (const double start : {0.0, 5.0, -5.0}) {
        expect_empty_at_one_half(
            start, [](double t) { return t < 0.5 ? IntervalSet(-1, 1) : IntervalSet(1, -1); });
        expect_empty_at_one_half(start, [](double t) { return IntervalSet::symmetric(1 - 2 * t); });
    }
    const auto run = hand_over(
        pushed(0.1, [](double t) { return IntervalSet::symmetric(t < 0.5 ? 1 : std::nan("")); }),
        one(5), {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_LE(run.t, 0.5);
}

/// Two relays; the set of the second becomes empty at t = 0.5.
struct SecondVanishes : TwinRelays {
    static void smooth(double, const Eigen::Vector2d&, Eigen::Vector2d& f) { f.setZero(); }
    static Box<2> reaction_set(double t, const Eigen::Vector2d&)
    {
        return Box<2>({-1, -1}, {1, t < 0.5 ? 1.0 : -2.0});
    }
};

TEST(HandOver, NamesTheReactionWhoseSetIsEmpty)
{
    const auto run = hand_over(SecondVanishes{}, Eigen::Vector2d(3, 3), {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::not_converged);
    EXPECT_NEAR(run.t, 0.5, 1e-9);
    EXPECT_EQ(run.failure.set, 1);
    EXPECT_NE(run.reason.find("form no interval"), std::string::npos) << run.reason;
    EXPECT_NEAR(run.x[0], 2.5, 1e-8);
}

// --- chattering ---

/// x'' = -sign x: a period of 4 |v|, however small v is at x = 0.
struct RelayTwoIntegrationsAway {
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 1;
    static void smooth(double, const Eigen::Vector2d& w, Eigen::Vector2d& f) { f << w[1], 0; }
    static IntervalSet reaction_set(double, const Eigen::Vector2d&)
    {
        return IntervalSet::symmetric(1);
    }
    static void act(Eigen::Vector2d& g) { g << 0, 1; }
};

TEST(HandOver, ChatteringIsSteppedOver)
{
    const auto run = hand_over(RelayTwoIntegrationsAway{}, Eigen::Vector2d(0, 1e-8), {.t_end = 1});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_GE(run.phases.size(), 2u);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::chattering);
    // A thousand steps of 1e-3, and a few hundred switches before each set-valued phase; the
    // patience of these phases doubles, so that a run of a thousand steps has few.
    EXPECT_LE(run.phases.size(), 16u);
    EXPECT_LE(run.set_valued.attempted, 1100u);
    EXPECT_LE(run.x.norm(), 1e-7);
}

TEST(HandOver, StepsOfBothKindsCountTowardsTheLimit)
{
    const auto run = hand_over(RelayTwoIntegrationsAway{}, Eigen::Vector2d(0, 1e-8),
                               {.t_end = 1, .max_steps = 700});
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    EXPECT_LE(run.statistics.steps - run.set_valued.accepted + run.set_valued.attempted, 700u);
    EXPECT_EQ(hand_over(SlidingMode{}, one(0.15), {.t_end = 1, .max_steps = 0}).outcome,
              Outcome::step_limit);
}

// --- reactions that move while everything is held ---

/// w' = load + r with r in [-1, 1], from rest.
struct Loaded {
    static constexpr int state_size = 1;
    static constexpr int reaction_size = 1;
    double slow = 0, fast = 0, frequency = 0;
    void smooth(double t, const One&, One& f) const
    {
        f[0] = slow * std::sin(t) + fast * std::sin(frequency * t);
    }
    static IntervalSet reaction_set(double, const One&) { return IntervalSet::symmetric(1); }
};

TEST(HandOver, EveryExitFromRestIsFound)
{
    // w' = 0 between the changes, so that only the reaction limits the step. In each half
    // of a period the load passes 1 at asin(1 / 1.05), and w is back at 0 before its end.
    const Loaded system{.fast = 1.05, .frequency = 10};
    constexpr double half = std::numbers::pi / 10;
    constexpr int halves = 120;
    const auto run = hand_over(system, one(0), {.t_end = halves * half});

    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 2u * halves);
    for (std::size_t i = 0; i < halves; ++i) {
        EXPECT_EQ(run.events[2 * i].kind, EventKind::slip);
        EXPECT_NEAR(run.events[2 * i].t, std::asin(1 / 1.05) / 10 + static_cast<double>(i) * half,
                    1e-9);
        EXPECT_EQ(run.events[2 * i + 1].kind, EventKind::stick);
    }
    // About ten steps for each change; a step that is repeated counts.
    EXPECT_LE(run.statistics.steps, 5000u);
}

TEST(HandOver, TwoSinesAsALoadMoveARelayFromRest)
{
    // The motion depends on the load alone; steps of 1/1000 of the run miss no change.
    for (int i = 0; i < 200; ++i) {
        const Loaded system{.slow = 0.7, .fast = 0.3 + 0.002 * i, .frequency = 3 + 0.07 * i};
        const auto run = hand_over(system, one(0), {.t_end = 20});
        const auto fine = hand_over(system, one(0), {.t_end = 20, .h_max = 0.02});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.events.size(), fine.events.size()) << i;
        EXPECT_NEAR(run.x[0], fine.x[0], 1e-8) << i;
        for (const auto& event : run.events) EXPECT_NE(event.mode_before, event.mode_after) << i;
    }
}

TEST(HandOver, ALoadOfTheSizeOfTheBoundIsHeldInLongSteps)
{
    // The reaction is a rounding away from its bound, which is no reason for short steps.
    for (const double load : {1.0, std::nextafter(1.0, 0.0), -1.0}) {
        const auto system = pushed(load, [](double) { return IntervalSet::symmetric(1); });
        const auto run = hand_over(system, one(0), {.t_end = 100});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.x[0], 0);
        EXPECT_LE(run.statistics.steps, 50u);
    }
}

// --- ends and bad input ---

TEST(HandOver, EndsAtOnceWhereItStarts)
{
    const auto run = hand_over(SlidingMode{}, one(0.15), {.t_end = 0});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x[0], 0.15);
}

TEST(HandOver, ReportsLimitsAndCancelling)
{
    const auto few =
        hand_over(DiodeCircuit{}, DiodeCircuit::start(), {.t_end = 20, .max_steps = 5});
    EXPECT_EQ(few.outcome, Outcome::step_limit);
    EXPECT_LT(few.t, 20);
    const std::atomic<bool> stop{true};
    const auto none =
        hand_over(InclineBlock{}, Eigen::Vector4d(1, 0, 0, 0), {.t_end = 2, .cancelled = &stop});
    EXPECT_EQ(none.outcome, Outcome::cancelled);
}

struct Singular : TwinRelays {
    static void mass(Eigen::Matrix2d& a) { a.setZero(); }
};

struct EmptySet : TwinRelays {
    static Box<2> reaction_set(double, const Eigen::Vector2d&) { return Box<2>({1, 1}, {-1, -1}); }
};

TEST(HandOver, RefusesWhatCannotBeRight)
{
    const Eigen::Vector2d zero(0, 0);
    const HandOverOptions fine{.t_end = 1};
    EXPECT_THROW((void)hand_over(Singular{}, zero, fine), std::invalid_argument);
    EXPECT_THROW((void)hand_over(EmptySet{}, zero, fine), std::invalid_argument);
    EXPECT_THROW((void)hand_over(TwinRelays{}, {std::nan(""), 0}, fine), std::invalid_argument);
    EXPECT_THROW((void)hand_over(TwinRelays{}, zero, {.t_start = 2, .t_end = 1}),
                 std::invalid_argument);
    EXPECT_THROW((void)hand_over(TwinRelays{}, zero, {.t_end = 1, .rtol = -1}),
                 std::invalid_argument);
    EXPECT_THROW((void)hand_over(TwinRelays{}, zero, {.t_end = 1, .h_max = 0}),
                 std::invalid_argument);
    EXPECT_THROW((void)hand_over(TwinRelays{}, zero, {.t_end = 1, .sample_times = {0.5, 0.2}}),
                 std::invalid_argument);
    HandOverOptions endless = fine;
    endless.set_valued.step = std::numeric_limits<double>::infinity();
    EXPECT_THROW((void)hand_over(TwinRelays{}, zero, endless), std::invalid_argument);
    EXPECT_THROW(RollingBall({.radius = 0}), std::invalid_argument);
    HandOverOptions controlled{.t_end = 1};
    controlled.set_valued.controller = FilteredStep::h211b(4);
    EXPECT_THROW((void)hand_over(TwinRelays{}, zero, controlled), std::invalid_argument);
    HandOverOptions estimated{.t_end = 1};
    estimated.set_valued.estimate = ErrorEstimate::doubling;
    EXPECT_THROW((void)hand_over(TwinRelays{}, zero, estimated), std::invalid_argument);
}

TEST(HandOver, RefusesOptionsInTheNameOfWhatTookThem)
{
    const Eigen::Vector2d zero(0, 0);
    const std::string sentence = "rtol must lie in [0, 1), got -1";
    EXPECT_EQ(refusal([&] { (void)integrate(TwinRelays{}, zero, {.t_end = 1, .rtol = -1}); }),
              "integrate: " + sentence);
    EXPECT_EQ(refusal([&] { (void)hand_over(TwinRelays{}, zero, {.t_end = 1, .rtol = -1}); }),
              "HandOverOptions: " + sentence);
}

/// A half line of reactions: beyond its surface the reaction would be infinite.
struct Obstacle : SlidingMode {
    static IntervalSet reaction_set(double, const One&) { return IntervalSet::half_line(); }
};

TEST(HandOver, RefusesAStartInsideAnObstacle)
{
    EXPECT_THROW((void)hand_over(Obstacle{}, one(-1), {.t_end = 1}), std::invalid_argument);
    EXPECT_EQ(hand_over(Obstacle{}, one(1), {.t_end = 0.1}).outcome, Outcome::reached_end);
}

}  // namespace
}  // namespace ricochet::hand_over_test
