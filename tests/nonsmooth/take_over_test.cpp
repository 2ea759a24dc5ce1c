// Ordinary hybrid systems whose inclusion takes over where their events cannot continue the motion.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::take_over_test {
namespace {

/// A mass on a spring and on a belt, written without regard to sticking: the
/// sign of the sliding velocity is a guard, and the flow uses it.
struct Belt {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    FrictionInclusion inclusion;
    static constexpr Crossing crossing = Crossing::either;

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        const double y = x[1] - inclusion.parameters().belt_speed;
        dxdt[0] = x[1];
        dxdt[1] = -x[0] - std::copysign(inclusion.friction(std::abs(y)), y);
    }
    [[nodiscard]] double guard(double /*t*/, const State& x) const
    {
        return x[1] - inclusion.parameters().belt_speed;
    }
    [[nodiscard]] const FrictionInclusion& set_valued() const { return inclusion; }
};

TEST(TakeOver, AMassThatWouldChatterSticks)
{
    // From 2 m against 0.3 N: it turns at pi, 2 pi and 3 pi, 0.6 m less each time, and stays at
    // -0.2 m, where the spring is weaker than friction.
    const Belt belt{FrictionInclusion({.friction = 0.3})};
    const auto run =
        integrate(belt, Belt::State{2, 0},
                  {.t_end = 12, .rtol = 1e-11, .atol = 1e-12, .sample_times = {5, 11}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.t, 12);
    EXPECT_NEAR(run.x[0], -0.2, 1e-9);
    EXPECT_EQ(run.x[1], 0);
    ASSERT_EQ(run.phases.size(), 2U);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::held);
    EXPECT_NEAR(run.phases[1].from, 3 * std::numbers::pi, 1e-4);
    for (std::size_t n = 0; n < 3; ++n) {
        EXPECT_NEAR(run.events[n].t, static_cast<double>(n + 1) * std::numbers::pi, 1e-9) << n;
    }
    // At 5 s: on the way from -1.4 about 0.3.
    ASSERT_EQ(run.trajectory.t.size(), 2U);
    EXPECT_NEAR(run.trajectory.x[0][0], -0.3 - 1.1 * std::cos(5 - std::numbers::pi), 1e-9);
    EXPECT_NEAR(run.trajectory.x[1][0], -0.2, 1e-9);
}

TEST(TakeOver, StickSlipIsGivenBackAtEverySlip)
{
    // It sticks to the belt until the spring is stretched to the largest static friction, 1 N at 1
    // m, then slips, and so on: the slips are one period apart.
    const Belt belt{FrictionInclusion(
        {.belt_speed = 0.2, .friction = 1, .weakening = 3, .law = FrictionLaw::hyperbolic})};
    const auto run =
        integrate(belt, Belt::State{0, 0.2}, {.t_end = 40, .rtol = 1e-11, .atol = 1e-12});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    const auto alone = hand_over(belt.inclusion, Eigen::Vector2d(0, 0.2),
                                 {.t_end = 40, .rtol = 1e-11, .atol = 1e-12});
    std::vector<double> slips;
    for (const auto& event : run.events) {
        if (event.kind == EventKind::slip) slips.push_back(event.t);
    }
    std::vector<double> expected;
    for (const auto& event : alone.events) {
        if (event.kind == EventKind::slip) expected.push_back(event.t);
    }
    ASSERT_GE(expected.size(), 3U);
    ASSERT_EQ(slips.size(), expected.size());
    // The spring reaches 1 m after 5 s on the belt.
    EXPECT_NEAR(slips[0], 5, 1e-9);
    for (std::size_t i = 0; i < slips.size(); ++i) EXPECT_NEAR(slips[i], expected[i], 1e-7) << i;
    const auto released = [](const MotionPhase& phase) {
        return phase.cause == PhaseCause::released;
    };
    EXPECT_GE(std::count_if(run.phases.begin(), run.phases.end(), released), 3);
    EXPECT_NEAR(run.x[0], alone.x[0], 1e-6);
}

TEST(TakeOver, StepsOfAllPhasesCountTowardsTheLimit)
{
    const Belt belt{FrictionInclusion(
        {.belt_speed = 0.2, .friction = 1, .weakening = 3, .law = FrictionLaw::hyperbolic})};
    const auto with = [&](std::uint64_t most) {
        return integrate(belt, Belt::State{0, 0.2},
                         {.t_end = 40, .rtol = 1e-11, .atol = 1e-12, .max_steps = most});
    };
    const auto taken = [](const auto& run) {
        return run.statistics.steps - run.set_valued.accepted + run.set_valued.attempted;
    };
    const std::uint64_t all = taken(with(1'000'000));
    // Three quarters of the steps end far after the first hand-over.
    const auto run = with(all * 3 / 4);
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    EXPECT_GT(run.phases.size(), 2U);
    EXPECT_LE(taken(run), all * 3 / 4);
    EXPECT_EQ(with(all + 1).outcome, Outcome::reached_end);
}

/// A relay with modes, whose reset alternates between the fields: endless at one instant.
struct Relay {
    using State = Eigen::Matrix<double, 1, 1>;
    SlidingMode inclusion;
    static constexpr std::size_t mode_count = 2;  // 0: w > 0, 1: w < 0

    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        inclusion.smooth(t, x, dxdt);
        dxdt[0] += mode == 0 ? -inclusion.parameters().gain : inclusion.parameters().gain;
    }
    [[nodiscard]] static GuardInfo guard_info()
    {
        GuardInfo info;
        info.unilateral = true;
        return info;
    }
    [[nodiscard]] static double guard(Mode mode, double /*t*/, const State& x)
    {
        return mode == 0 ? x[0] : -x[0];
    }
    static Mode reset(Mode mode, double /*t*/, State& /*x*/) { return 1 - mode; }
    [[nodiscard]] static Mode start_mode(double /*t*/, const State& x) { return x[0] > 0 ? 0 : 1; }
    [[nodiscard]] const SlidingMode& set_valued() const { return inclusion; }
};

TEST(TakeOver, TwoFieldsThatPointAtEachOtherSlide)
{
    const Relay relay;
    const auto run = integrate(relay, Relay::State(Relay::State::Constant(SlidingMode::start)),
                               {.t_end = SlidingMode::t_end, .rtol = 1e-12, .atol = 1e-13});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.phases.size(), 2U);
    // As `HandOver.SlidingModeReachesZeroInTimeAndStaysThereToTheBit`.
    EXPECT_NEAR(run.phases[1].from, 0.093315472931294579027, 1e-12);
    EXPECT_EQ(run.x[0], 0);
}

/// A mass on a spring, under two sines, on an oscillating surface: w' = B w + load + friction.
struct LoadedInclusion {
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 1;
    using Vector = Eigen::Vector2d;

    double stiffness, damping, friction, weakening, swing;
    std::array<double, 3> frequency, phase;  // of the loads and the swing
    std::array<double, 2> amplitude;

    void smooth(double t, const Vector& w, Vector& f) const
    {
        f[0] = w[1];
        f[1] = -stiffness * w[0] - damping * w[1];
        for (std::size_t i = 0; i < 2; ++i) {
            f[1] += amplitude[i] * std::sin(frequency[i] * t + phase[i]);
        }
    }
    void observe(Eigen::Matrix<double, 1, 2>& e) const { e << 0, 1; }
    void offset(double t, Eigen::Matrix<double, 1, 1>& s) const
    {
        s[0] = swing * std::sin(frequency[2] * t + phase[2]);
    }
    void offset_rate(double t, Eigen::Matrix<double, 1, 1>& s) const
    {
        s[0] = swing * frequency[2] * std::cos(frequency[2] * t + phase[2]);
    }
    [[nodiscard]] double sliding(double t, const Vector& w) const
    {
        return w[1] - swing * std::sin(frequency[2] * t + phase[2]);
    }
    [[nodiscard]] sets::Box<1> reaction_set(double t, const Vector& w) const
    {
        const double bound = friction / (1 + weakening * std::abs(sliding(t, w)));
        return sets::Box<1>({-bound}, {bound});
    }
    [[nodiscard]] double branch_bound(double t, const Vector& w, int, Branch branch) const
    {
        const double y = sliding(t, w);
        return branch == Branch::upper ? friction / std::max(0.5, 1 - weakening * y)
                                       : -friction / std::max(0.5, 1 + weakening * y);
    }
};

/// The same with a recorded guard, whose crossings do not cut steps.
struct LoadedBelt {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    LoadedInclusion inclusion;
    static constexpr Crossing crossing = Crossing::either;

    void flow(double t, const State& x, State& dxdt) const
    {
        Eigen::Vector2d f;
        const Eigen::Vector2d w(x[0], x[1]);
        inclusion.smooth(t, w, f);
        const auto set = inclusion.reaction_set(t, w);
        dxdt = {f[0], f[1] + (guard(t, x) >= 0 ? set.lower(0) : set.upper(0))};
    }
    [[nodiscard]] double guard(double t, const State& x) const
    {
        return inclusion.sliding(t, {x[0], x[1]});
    }
    [[nodiscard]] const LoadedInclusion& set_valued() const { return inclusion; }
};

/// The run agrees with that of the inclusion alone, and its sticking does not cause many
/// crossings: far fewer than the 401 a phase that a run by events needs to see that it chatters.
void expect_few_crossings(const LoadedBelt& belt, const LoadedBelt::State& x0, double t_end,
                          double tolerance)
{
    const auto run = integrate(
        belt, x0, {.t_end = t_end, .rtol = tolerance, .atol = tolerance / 10, .max_steps = 30'000});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_LE(run.events.size(), 401 * run.phases.size());
    const auto alone = hand_over(belt.inclusion, Eigen::Vector2d(x0[0], x0[1]), {.t_end = t_end});
    // A crossing within a step adds up to the error of a step, at each of some hundred.
    EXPECT_NEAR(run.x[0], alone.x[0], 1e4 * tolerance);
    EXPECT_NEAR(run.x[1], alone.x[1], 1e4 * tolerance);
}

TEST(TakeOver, SwitchingWithinTheErrorOfStepsIsHandedOver)
{
    const LoadedInclusion inclusion{
        .stiffness = 2.0943252172686426,
        .damping = 0.20186324197356434,
        .friction = 0.54675542816147193,
        .weakening = 0,
        .swing = -0.02717347791610919,
        .frequency = {5.0616478650458143, 6.3717403728177855, 1.2336420966897188},
        .phase = {3.6700139524012823, 0, 4.964970070137162},
        .amplitude = {-0.89539949334101032, -0.86375976896689943}};
    expect_few_crossings({inclusion}, {-0.11594614767161704, 0.026311280394670216},
                         3.233838431914299, 1e-8);
}

/// A mass that a spring pulls, on dry friction. Every second an event is recorded, and the one
/// after 8 s throws it.
struct Thrown {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    struct Friction {
        static constexpr int state_size = 2;
        static constexpr int reaction_size = 1;
        static void smooth(double, const Eigen::Vector2d& w, Eigen::Vector2d& f)
        {
            f << w[1], -w[0];
        }
        static void observe(Eigen::Matrix<double, 1, 2>& e) { e << 0, 1; }
        [[nodiscard]] static sets::Box<1> reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::Box<1>({-1}, {1});
        }
    };
    static constexpr Crossing crossing = Crossing::either;

    static void flow(double, const State& x, State& dxdt)
    {
        dxdt = {x[1], -x[0] - (x[1] >= 0 ? 1 : -1)};
    }
    [[nodiscard]] static double guard(double, const State& x) { return x[1]; }
    [[nodiscard]] static double next_time_event(double t) { return std::floor(t) + 1; }
    static void time_reset(double t, State& x)
    {
        if (t == 8) x[1] = 3;
    }
    [[nodiscard]] static Friction set_valued() { return {}; }
};

TEST(TakeOver, TimeEventsHappenUnderTheInclusion)
{
    const auto run =
        integrate(Thrown{}, Thrown::State{2.5, 0.1},
                  {.t_end = 10, .rtol = 1e-10, .atol = 1e-12, .sample_times = {7.5, 8, 9}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    std::vector<double> times;
    for (const auto& event : run.events) {
        if (event.kind == EventKind::time) times.push_back(event.t);
    }
    EXPECT_EQ(times, (std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
    ASSERT_EQ(run.trajectory.x.size(), 3U);
    EXPECT_NEAR(run.trajectory.x[0][1], 0, 1e-9);
    EXPECT_EQ(run.trajectory.x[1][1], 3);
    // From the throw on the mass turns about -1.
    const double from = run.trajectory.x[1][0] + 1;
    EXPECT_NEAR(run.trajectory.x[2][0], -1 + from * std::cos(1) + 3 * std::sin(1), 1e-8);
    EXPECT_NEAR(run.trajectory.x[2][1], 3 * std::cos(1) - from * std::sin(1), 1e-8);
}

/// A mass that a load pulls beyond its friction every few seconds, kicked every `interval`.
struct Kicked {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    struct Friction {
        static constexpr int state_size = 2;
        static constexpr int reaction_size = 1;
        static void smooth(double t, const Eigen::Vector2d& w, Eigen::Vector2d& f)
        {
            f << w[1], 1.2 * std::sin(t);
        }
        static void observe(Eigen::Matrix<double, 1, 2>& e) { e << 0, 1; }
        [[nodiscard]] static sets::Box<1> reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::Box<1>({-1}, {1});
        }
    };
    static constexpr Crossing crossing = Crossing::either;
    double interval;

    static void flow(double t, const State& x, State& dxdt)
    {
        dxdt = {x[1], 1.2 * std::sin(t) - (x[1] >= 0 ? 1 : -1)};
    }
    [[nodiscard]] static double guard(double, const State& x) { return x[1]; }
    [[nodiscard]] double next_time_event(double t) const
    {
        int k = 1;
        while (interval * k <= t) ++k;
        return interval * k;
    }
    static void time_reset(double, State& x) { x[1] += 0.01; }
    [[nodiscard]] static Friction set_valued() { return {}; }
};

TEST(TakeOver, ATimeEventAtWhichTheInclusionEndsIsNotLost)
{
    for (int i = 0; i < 40; ++i) {
        const Kicked kicked{0.5003 + 0.01 * i};
        const auto run =
            integrate(kicked, Kicked::State{0, 0.1}, {.t_end = 10, .rtol = 1e-8, .atol = 1e-10});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        const auto times = std::count_if(run.events.begin(), run.events.end(),
                                         [](const auto& e) { return e.kind == EventKind::time; });
        EXPECT_EQ(times, std::floor(10 / kicked.interval)) << kicked.interval;
    }
}

TEST(TakeOver, EventsThatAreNotRecordedAreStillReviewed)
{
    const Kicked kicked{0.7};
    const Options options{.t_end = 10, .rtol = 1e-8, .atol = 1e-10, .max_steps = 20'000};
    Options quiet = options;
    quiet.record_events = false;
    const auto recorded = integrate(kicked, Kicked::State{0, 0.1}, options);
    const auto run = integrate(kicked, Kicked::State{0, 0.1}, quiet);
    EXPECT_EQ(run.outcome, recorded.outcome);
    EXPECT_EQ(run.x, recorded.x);
    EXPECT_EQ(run.phases.size(), recorded.phases.size());
    EXPECT_EQ(run.statistics.events, recorded.statistics.events);
    EXPECT_TRUE(run.events.empty());
    EXPECT_TRUE(integrate(SlidingMode{}, Relay::State::Constant(0.15), quiet).events.empty());
}

/// The same with a guard that is narrow, so that steps are divided for it.
struct Divided : Thrown {
    static constexpr std::size_t guard_count = 2;
    [[nodiscard]] static double guard(std::size_t which, double, const State& x)
    {
        return which == 0 ? x[1] : 1 - 1.1 * std::exp(-std::pow((x[0] - 1) / 0.02, 2));
    }
    [[nodiscard]] static GuardInfo guard_info(std::size_t /*which*/)
    {
        GuardInfo info;
        info.crossing = Crossing::either;
        return info;
    }
};

TEST(TakeOver, StatisticsCountDividedSteps)
{
    const auto run = integrate(Divided{}, Divided::State{2.5, 0.1}, {.t_end = 10, .rtol = 1e-10});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.statistics.refined_steps, 0U);
}

TEST(TakeOver, AnInclusionAloneNeedsNoOtherCall)
{
    const auto run =
        integrate(SlidingMode{}, SlidingMode::Vector(SlidingMode::Vector::Constant(0.15)),
                  {.t_end = 0.5, .rtol = 1e-12, .atol = 1e-13});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_NEAR(run.events[0].t, 0.093315472931294579027, 1e-12);
}

/// The same, to be ended by a number of crossings.
struct Ended : Thrown {
    std::uint32_t most;
    [[nodiscard]] GuardInfo guard_info() const
    {
        GuardInfo info;
        info.crossing = Crossing::either;
        info.stop_after = most;
        return info;
    }
};

TEST(TakeOver, StopsAfterOneEventAndAfterSeveral)
{
    const Ended::State x0{2.5, 0.1};
    const auto run = integrate(Ended{{}, 1}, x0, {.t_end = 10});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_LT(run.t, 1);
    const auto later = integrate(Ended{{}, 2}, x0, {.t_end = 10});
    EXPECT_EQ(later.outcome, Outcome::stopped_by_event);
    EXPECT_GT(later.t, run.t);
}

TEST(TakeOver, RefusesWhatAHandOverDoesNotHave)
{
    const Belt belt;
    const Belt::State x0{2, 0};
    EXPECT_THROW((void)integrate(belt, x0, {.t_end = -1}), std::invalid_argument);
    EXPECT_THROW((void)integrate(belt, x0, {.t_end = 1, .rtol = -1}), std::invalid_argument);
}

TEST(TakeOver, RefusesOptionsThatARunOfAnInclusionAloneDoesNotUse)
{
    const SlidingMode inclusion;
    const auto start = StateOf<SlidingMode>::Constant(1).eval();
    const Options fine{.t_end = 1};
    EXPECT_EQ(integrate(inclusion, start, fine).outcome, Outcome::reached_end);
    const auto refused = [&](const auto& change, const std::string& name) {
        Options options = fine;
        change(options);
        try {
            (void)integrate(inclusion, start, options);
            ADD_FAILURE() << name;
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find(" no " + name), std::string::npos)
                << error.what();
        }
    };
    refused([](Options& o) { o.mode = 1; }, "mode");
    refused([](Options& o) { o.step = 0.1; }, "step");
    refused([](Options& o) { o.h_min = 1e-9; }, "h_min");
    refused([](Options& o) { o.event_rtol = 1e-9; }, "event_rtol");
    refused([](Options& o) { o.event_window = 1e-9; }, "event_window");
    refused([](Options& o) { o.check_inside = false; }, "check_inside");
}

}  // namespace
}  // namespace ricochet::take_over_test
