// Reactions that hold more than they have where y moves: static friction above kinetic friction.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "phased_runs.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::static_friction_test {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();

/// w' = F(t) - R, |R| <= kinetic where w moves and <= static where it rests.
struct Block {
    static constexpr int state_size = 1, reaction_size = 1;
    using W = Eigen::Matrix<double, 1, 1>;
    std::function<double(double)> load;
    double at_rest = 1, kinetic = 0.5;

    void smooth(double t, const W& w, W& f) const { f[0] = load(t) + 0 * w[0]; }
    [[nodiscard]] sets::IntervalSet reaction_set(double, const W&) const
    {
        return sets::IntervalSet::symmetric(kinetic);
    }
    [[nodiscard]] double static_bound(double, const W&, int) const { return at_rest; }
};

Run<StateOf<Block>> slide(const Block& block, double w0, double t_end)
{
    return hand_over(block, Block::W{w0}, {.t_end = t_end});
}

TEST(StaticFriction, ABlockSlipsWhereItsLoadPassesTheStaticBound)
{
    const auto run = slide({.load = [](double t) { return t / 5; }}, 0, 6);
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].kind, EventKind::slip);
    EXPECT_NEAR(run.events[0].t, 5, 1e-12);
    EXPECT_NEAR(run.x[0], 0.6, 1e-10);
    EXPECT_NEAR(run.reaction[0], -0.5, 1e-15);
    const auto back = slide({.load = [](double t) { return -t / 5; }}, 0, 6);
    EXPECT_NEAR(back.x[0], -0.6, 1e-10);
}

TEST(StaticFriction, ALoadThatRestsAtTheStaticBoundMovesNothing)
{
    const auto equal = slide({.load = [](double t) { return std::min(t, 1.0); }}, 0, 2);
    EXPECT_EQ(equal.outcome, Outcome::reached_end);
    EXPECT_EQ(equal.events.size(), 0u);
    EXPECT_EQ(equal.x[0], 0);
    const auto more = slide({.load = [](double t) { return std::min(t, 1 + 1e-6); }}, 0, 2);
    ASSERT_EQ(more.events.size(), 1u);
    EXPECT_NEAR(more.events[0].t, 1, 1e-12);
    EXPECT_NEAR(more.x[0], 0.500001, 1e-9);
    const auto constant = slide({.load = [](double) { return 1.0; }}, 0, 2);
    EXPECT_EQ(constant.x[0], 0);
    EXPECT_EQ(constant.events.size(), 0u);
    const auto touches = slide({.load = [](double t) { return 2 * t - t * t; }}, 0, 2);
    EXPECT_EQ(touches.x[0], 0);
    EXPECT_EQ(touches.events.size(), 0u);
}

TEST(StaticFriction, ABlockThatStopsIsHeldThoughTheKineticLawWouldLetItTurn)
{
    const auto run = slide({.load = [](double) { return -0.7; }}, 1.2, 3);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].kind, EventKind::stick);
    EXPECT_NEAR(run.events[0].t, 1, 1e-12);
    EXPECT_EQ(run.x[0], 0);
    EXPECT_NEAR(run.reaction[0], 0.7, 1e-15);
    const auto turns = slide({.load = [](double) { return -1.1; }}, 1.6, 3);
    ASSERT_EQ(turns.events.size(), 1u);
    EXPECT_EQ(turns.events[0].kind, EventKind::mode);
    EXPECT_NEAR(turns.x[0], -0.6 * 2, 1e-10);
}

// Stick and slip on a belt, whose period has a closed form.
struct Belt {
    static constexpr int state_size = 2, reaction_size = 1;
    using W = Eigen::Vector2d;
    void smooth(double, const W& w, W& f) const { f << w[1], -w[0]; }
    [[nodiscard]] sets::IntervalSet reaction_set(double, const W&) const
    {
        return sets::IntervalSet::symmetric(0.5);
    }
    [[nodiscard]] double static_bound(double, const W&, int) const { return 1; }
    void observe(Eigen::Matrix<double, 1, 2>& e) const { e << 0, 1; }
    void offset(double, Eigen::Matrix<double, 1, 1>& s) const { s[0] = 0.2; }
    void offset_rate(double, Eigen::Matrix<double, 1, 1>& rate) const { rate[0] = 0; }
};

// It is carried to x = 1, slides about 1/2 with amplitude r and phase a until it is as fast as the
// belt again at x = 0, and is carried over the distance 1 once more.
TEST(StaticFriction, ABlockOnABeltSticksAndSlipsWithItsPeriod)
{
    const double a = std::atan2(0.2, 0.5);
    const double slides = std::numbers::pi + 2 * a, carried = 1 / 0.2;
    const auto run = hand_over(Belt{}, Belt::W(0, 0.2), {.t_end = 100});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_GE(run.events.size(), 18u);
    for (std::size_t k = 0; k < run.events.size(); ++k) {
        const double rounds = static_cast<double>(k / 2);
        const bool slip = k % 2 == 0;
        EXPECT_EQ(run.events[k].kind, slip ? EventKind::slip : EventKind::stick);
        EXPECT_NEAR(run.events[k].t, rounds * (slides + carried) + carried + (slip ? 0 : slides),
                    1e-8);
    }
}

/// Two joints, w' = W (f + r), W = [[1, -1], [-1, 2]].
struct Joints {
    static constexpr int state_size = 2, reaction_size = 2;
    using W = Eigen::Vector2d;
    double second = -0.8, kinetic = 0.5;

    void smooth(double t, const W&, W& f) const { f << t - second, -t + 2 * second; }
    [[nodiscard]] sets::Box<2> reaction_set(double, const W&) const
    {
        return {{-kinetic, -kinetic}, {kinetic, kinetic}};
    }
    [[nodiscard]] double static_bound(double, const W&, int) const { return 1; }
    void act(Eigen::Matrix2d& g) const { g << 1, -1, -1, 2; }
};

void expect_slips(const Run<StateOf<Joints>>& run, double first, double second)
{
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 2u);
    for (const auto& event : run.events) EXPECT_EQ(event.kind, EventKind::slip);
    EXPECT_EQ(run.events[0].reaction, 0u);
    EXPECT_EQ(run.events[1].reaction, 1u);
    EXPECT_NEAR(run.events[0].t, first, 1e-11);
    EXPECT_NEAR(run.events[1].t, second, 1e-11);
}

TEST(StaticFriction, AReactionThatFallsToItsKineticBoundMayReleaseAnother)
{
    const auto both = hand_over(Joints{}, Joints::W(0, 0), {.t_end = 2});
    expect_slips(both, 1, 1);
    EXPECT_NEAR(both.x[0], 1.3, 1e-10);
    EXPECT_NEAR(both.x[1], -1.6, 1e-10);
    const auto later = hand_over(Joints{.second = -0.7}, Joints::W(0, 0), {.t_end = 2});
    expect_slips(later, 1, 1.1);
    EXPECT_NEAR(later.x[0], 1.1525, 1e-10);
    EXPECT_NEAR(later.x[1], -1.305, 1e-10);
    const auto equal = hand_over(Joints{.kinetic = 1}, Joints::W(0, 0), {.t_end = 2});
    expect_slips(equal, 1, 1.4);
    EXPECT_NEAR(equal.x[0], 0.34, 1e-10);
    EXPECT_NEAR(equal.x[1], -0.18, 1e-10);
}

// --- beside events ---

/// The block as a system with a clock, whose ticks may turn it or do nothing.
struct Ticking {
    using State = std::array<double, 1>;
    Block block;
    double tick = 1;
    bool turns = false;
    std::array<double, 2> at_tick = {0, 0};

    void flow(double t, const State& x, State& v) const
    {
        const double bound = block.kinetic;
        v[0] = block.load(t) - (x[0] > 0 ? bound : x[0] < 0 ? -bound : 0);
    }
    [[nodiscard]] double next_time_event(double t) const { return t < tick ? tick : never; }
    void time_reset(double, State& x) const
    {
        if (turns) x[0] = -x[0];
    }
    [[nodiscard]] const Block& set_valued() const { return block; }
};

Run<std::array<double, 1>> tick(const Ticking& system, double w0, double t_end)
{
    return run_of(system, std::array{w0}, until(t_end));
}

TEST(StaticFriction, ATickAtTheStaticBoundChangesNothing)
{
    const auto rests = tick({.block = {.load = [](double t) { return std::min(t, 1.0); }}}, 0, 2);
    EXPECT_EQ(rests.outcome, Outcome::reached_end);
    EXPECT_EQ(rests.x[0], 0);
    EXPECT_EQ(rests.events.size(), 1u);
    const auto slips =
        tick({.block = {.load = [](double t) { return std::min(t, 1 + 1e-6); }}, .tick = 1 + 1e-6},
             0, 2);
    EXPECT_NEAR(slips.x[0], 0.500001, 1e-9);
    // A load that is gone at the tick at which it meets the bound.
    const auto gone = tick({.block = {.load = [](double t) { return t < 1 ? t : 0; }}}, 0, 2);
    EXPECT_EQ(gone.x[0], 0);
    ASSERT_EQ(gone.events.size(), 1u);
    EXPECT_EQ(gone.events[0].kind, EventKind::time);
}

TEST(StaticFriction, AResetThatCarriesTheBlockAcrossRestIsNoStop)
{
    const auto run = tick(
        {.block = {.load = [](double) { return -0.7; }}, .tick = 0.5, .turns = true}, 1.2, 1.5);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], -0.8, 1e-9);
    for (const auto& event : run.events) EXPECT_NE(event.kind, EventKind::stick);
}

// The runs of inclusions above, through all adapters.
TEST(StaticFriction, BesideAFlowItIsTheSame)
{
    using One = std::array<double, 1>;
    using Two = std::array<double, 2>;
    const auto block = [](auto load) { return WithSigns<Block>{{.load = load}}; };
    const auto grows = run_of(block([](double t) { return t / 5; }), One{0}, until(6));
    expect_end(grows, One{0.6});
    expect_times(times_of(grows.events, EventKind::slip), {5});
    expect_end(run_of(block([](double) { return 1.0; }), One{0}, until(2)), One{0}, 0);
    const auto stops = run_of(block([](double) { return -0.7; }), One{1.2}, until(3));
    expect_end(stops, One{0}, 0);
    expect_times(times_of(stops.events, EventKind::stick), {1});
    expect_end(run_of(WithSigns<Joints>{}, Two{0, 0}, until(2)), Two{1.3, -1.6});
    const WithSigns<Joints> later{{.second = -0.7}}, equal{{.kinetic = 1}};
    expect_end(run_of(later, Two{0, 0}, until(2)), Two{1.1525, -1.305});
    expect_end(run_of(equal, Two{0, 0}, until(2)), Two{0.34, -0.18});
}

TEST(StaticFriction, ASimulationGoesOnFromASnapshotOfAHeldBlock)
{
    const Ticking system{.block = {.load = [](double t) { return t / 5; }}, .tick = 3};
    const Options options{.t_end = 6, .rtol = 1e-10, .atol = 1e-12};
    Simulation first(system, std::array{0.0}, options);
    while (first.t() < 4) (void)first.step();
    Simulation second(system, std::array{0.0}, options);
    second.restore(first.save());
    while (!second.ended()) (void)second.step();
    EXPECT_NEAR(second.x()[0], 0.6, 1e-9);
}

/// Two blocks on one another: y = w0 - w1, friction 1, unit masses. A tick sets both to speeds that
/// are equal up to rounding.
struct Pair {
    static constexpr int state_size = 2, reaction_size = 1;
    using W = Eigen::Vector2d;
    void smooth(double, const W&, W& f) const { f.setZero(); }
    [[nodiscard]] sets::IntervalSet reaction_set(double, const W&) const { return {-1, 1}; }
    void observe(Eigen::Matrix<double, 1, 2>& e) const { e << 1, -1; }
};
struct TickingPair {
    using State = std::array<double, 2>;
    Pair pair;
    void flow(double, const State& x, State& v) const
    {
        const double r = x[0] > x[1] ? -1 : x[0] < x[1] ? 1 : 0;
        v = {r, -r};
    }
    [[nodiscard]] double next_time_event(double t) const { return t < 1 ? 1 : never; }
    void time_reset(double, State& x) const { x = {0.3, 0.1 + 0.2}; }
    [[nodiscard]] const Pair& set_valued() const { return pair; }
};

TEST(StaticFriction, SpeedsThatAreEqualUpToRoundingAreHeldOn)
{
    const auto run = run_of(TickingPair{}, std::array{1.0, 0.0}, until(3));
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 2u);
    EXPECT_EQ(run.events[0].kind, EventKind::stick);
    EXPECT_NEAR(run.events[0].t, 0.5, 1e-12);
    EXPECT_EQ(run.events[1].kind, EventKind::time);
    EXPECT_NEAR(run.x[0], 0.3, 1e-15);
    EXPECT_NEAR(run.x[1], 0.3, 1e-15);
}

// --- refusals ---

TEST(StaticFriction, AStaticBoundBelowTheKineticOneIsRefused)
{
    const Block block{.load = [](double) { return 0.0; }, .at_rest = 0.4};
    try {
        (void)slide(block, 0, 1);
        FAIL() << "not refused";
    } catch (const std::invalid_argument& error) {
        const std::string text = error.what();
        EXPECT_NE(text.find("static bound"), std::string::npos) << text;
        EXPECT_NE(text.find("0.4"), std::string::npos) << text;
        EXPECT_NE(text.find("0.5"), std::string::npos) << text;
    }
}

/// Static friction that is written into the set.
struct Jumping {
    static constexpr int state_size = 1, reaction_size = 1;
    using W = Eigen::Matrix<double, 1, 1>;
    void smooth(double t, const W&, W& f) const { f[0] = t; }
    [[nodiscard]] sets::IntervalSet reaction_set(double, const W& w) const
    {
        return sets::IntervalSet::symmetric(w[0] == 0 ? 1 : 0.5);
    }
};

TEST(StaticFriction, ASetThatJumpsWhereTheMotionRestsIsRefused)
{
    for (const double w0 : {0.0, 3.0}) {
        try {
            (void)hand_over(Jumping{}, Jumping::W{w0}, {.t_end = 1});
            FAIL() << "not refused";
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find("static_bound"), std::string::npos);
        }
    }
}

// --- several contacts of one block ---

/// Two contacts of one block, of static bounds 1 and 3 and half of them where it moves.
struct OneBlock {
    static constexpr int state_size = 1, reaction_size = 2;
    using W = Eigen::Matrix<double, 1, 1>;
    double load = 0, growth = 1;  ///< the load is load + growth t

    void smooth(double t, const W&, W& f) const { f[0] = load + growth * t; }
    [[nodiscard]] static sets::Box<2> reaction_set(double, const W&)
    {
        return {{-0.5, -1.5}, {0.5, 1.5}};
    }
    [[nodiscard]] static double static_bound(double, const W&, int i) { return i == 0 ? 1 : 3; }
    static void observe(Eigen::Matrix<double, 2, 1>& e) { e << 1, 1; }
};

TEST(StaticFriction, TwoContactsOfOneBlockHoldTogetherAndSlipTogether)
{
    // They hold 4 between them, and 2 where the block moves: (t - 4)^2 / 2 + 2 (t - 4) after 4.
    // Of all reactions that hold it they are the least.
    for (const double way : {1.0, -1.0}) {
        HandOverOptions options{.t_end = 6, .sample_times = {2, 3, 3.9, 5}};
        const auto run = hand_over(OneBlock{.growth = way}, OneBlock::W{0}, options);
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        ASSERT_EQ(run.events.size(), 2U);
        for (std::size_t i = 0; i < 2; ++i) {
            EXPECT_EQ(run.events[i].kind, EventKind::slip);
            EXPECT_EQ(run.events[i].reaction, i);
            EXPECT_NEAR(run.events[i].t, 4, 1e-11);
        }
        EXPECT_NEAR(run.x[0], way * 6, 1e-9);
        const double least[4][2] = {{1, 1}, {1, 2}, {1, 2.9}, {0.5, 1.5}};
        for (std::size_t k = 0; k < 4; ++k) {
            EXPECT_NEAR(run.reactions[k][0], -way * least[k][0], 1e-12) << k;
            EXPECT_NEAR(run.reactions[k][1], -way * least[k][1], 1e-12) << k;
        }
    }
}

TEST(StaticFriction, TwoContactsHoldABlockThatStopsUnderALoadBetweenTheirBounds)
{
    // w' = -3 - 2 from 5: at rest at 1, where 3 of 4 are needed.
    const auto run = hand_over(OneBlock{-3, 0}, OneBlock::W{5}, {.t_end = 3});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 2U);
    for (const auto& event : run.events) {
        EXPECT_EQ(event.kind, EventKind::stick);
        EXPECT_NEAR(event.t, 1, 1e-12);
    }
    EXPECT_EQ(run.x[0], 0);
    EXPECT_NEAR(run.reaction[0], 1, 1e-12);
    EXPECT_NEAR(run.reaction[1], 2, 1e-12);
    const WithSigns<OneBlock> beside{};
    const auto slips = run_of(beside, std::array{0.0}, until(6));
    expect_end(slips, std::array{6.0});
    expect_times(times_of(slips.events, EventKind::slip), {4, 4});
    expect_end(run_of(WithSigns<OneBlock>{{-3, 0}}, std::array{5.0}, until(3)), std::array{0.0}, 0);
    // A load of just what they hold, and one beyond it.
    EXPECT_EQ(hand_over(OneBlock{4, 0}, OneBlock::W{0}, {.t_end = 1}).x[0], 0);
    EXPECT_NEAR(hand_over(OneBlock{4.5, 0}, OneBlock::W{0}, {.t_end = 1}).x[0], 2.5, 1e-9);
}

/// Two blocks on each other, pulled by t: contact 0 between them, 1 and 2 of the lower one with
/// the ground, the last over a lever of 2.
struct ThreeContacts {
    using State = std::array<double, 2>;
    struct Motion {
        static constexpr int state_size = 2, reaction_size = 3;
        using W = Eigen::Vector2d;
        static void smooth(double t, const W&, W& f) { f << 0, t; }
        [[nodiscard]] static sets::Box<3> reaction_set(double, const W&)
        {
            return {{-0.25, -0.5, -0.5}, {0.25, 0.5, 0.5}};
        }
        [[nodiscard]] static double static_bound(double, const W&, int) { return 1; }
        static void observe(Eigen::Matrix<double, 3, 2>& e) { e << 1, -1, 0, 1, 0, -2; }
    };
    static void flow(double t, const State& x, State& dxdt)
    {
        const auto sign = [](double y) { return y > 0 ? 1 : y < 0 ? -1 : 0; };
        const double between = -0.25 * sign(x[0] - x[1]);
        dxdt = {between, t - between - 1.5 * sign(x[1])};
    }
    [[nodiscard]] static double next_time_event(double t) { return std::floor(t) + 1; }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(StaticFriction, ContactsWithTheGroundSlipTogetherUnderABlockThatRidesOn)
{
    // The ground holds 1 + 2 up to 3, and 1.5 after it: there the upper block is carried by half
    // of 1.5, less than 1, and both have the acceleration (t - 1.5) / 2. At 3.5 it would need 1,
    // and slips: v = (0.5 * 0.75 + 0.5^2 / 4 = 0.4375) there, then 1/4, and t - 1.75.
    const Options options = until(4);
    const auto run = run_of(ThreeContacts{}, ThreeContacts::State{0, 0}, options);
    expect_end(run, ThreeContacts::State{0.4375 + 0.125, 0.4375 + 0.5 * (1.75 + 2.25) / 2}, 1e-9);
    std::array<std::vector<double>, 3> slips;
    for (const auto& event : run.events) {
        if (event.kind == EventKind::slip) slips[event.reaction].push_back(event.t);
    }
    expect_times(slips[0], {3.5});
    expect_times(slips[1], {3});
    expect_times(slips[2], {3});
}

/// Three relays in a plane, of which one is the sum of the others.
struct InAPlane {
    static constexpr int state_size = 2, reaction_size = 3;
    using W = Eigen::Vector2d;
    static void smooth(double, const W&, W& f) { f << 0.5, 0.25; }
    [[nodiscard]] static sets::Box<3> reaction_set(double, const W&)
    {
        return {{-1, -1, -1}, {1, 1, 1}};
    }
    [[nodiscard]] static double static_bound(double, const W&, int) { return 2; }
    static void observe(Eigen::Matrix<double, 3, 2>& e) { e << 1, 0, 0, 1, 1, 1; }
};

TEST(StaticFriction, ReactionsThatAreCombinationsOfOthersEndTheRunWithItsReason)
{
    const auto run = hand_over(InAPlane{}, InAPlane::W(0, 0), {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::not_handed_over);
    EXPECT_EQ(run.reason,
              "implicit steps are due at t = 0 (no_flow), and they do not know static bounds");
}

// --- on a plane ---

/// A body on a plane, A v' = f(t) + r, where |r| is at most `at_rest` and, where v moves,
/// `kinetic`.
struct Disc {
    static constexpr int state_size = 2, reaction_size = 2;
    using W = Eigen::Vector2d;
    std::function<W(double)> load;
    double at_rest = 1, kinetic = 0.5, second_mass = 1;

    void smooth(double t, const W&, W& f) const { f = load(t); }
    void mass(Eigen::Matrix2d& a) const { a << 1, 0, 0, second_mass; }
    [[nodiscard]] sets::Ball<2> reaction_set(double, const W&) const
    {
        return sets::Ball<2>(kinetic);
    }
    [[nodiscard]] double static_bound(double, const W&, int) const { return at_rest; }
};

/// Steps of second order at 1e-10 a step, some hundred of them.
constexpr double of_steps = 1e-8;

TEST(StaticFriction, ADiscSlipsWhereItsLoadPassesTheStaticBound)
{
    // The load t/5 passes 1 at 5; v' = t/5 - 1/2 along it from then on: 0.6 at 6.
    const Disc disc{.load = [](double t) { return Disc::W(Disc::W(0.6, 0.8) * t / 5); }};
    const auto run = hand_over(disc, Disc::W{0, 0}, {.t_end = 6});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 0.36, of_steps);
    EXPECT_NEAR(run.x[1], 0.48, of_steps);
    EXPECT_NEAR(std::hypot(run.reaction[0], run.reaction[1]), 0.5, of_steps);
    const auto held = hand_over(disc, Disc::W{0, 0}, {.t_end = 5 - 1e-9});
    EXPECT_EQ(held.x, Disc::W(0, 0));
    EXPECT_NEAR(std::hypot(held.reaction[0], held.reaction[1]), 1, 1e-9);
}

TEST(StaticFriction, ADiscLeavesAlongTheDirectionThatItsKineticLawHasThere)
{
    // At 1, f = (0.6, 0.8) and W = diag(1, 1/4). With v' = lambda d and |d| = 1 the law is
    // (lambda + W / 2) d = W f, from which d follows by one equation for lambda.
    const Disc disc{.load = [](double t) { return Disc::W(Disc::W(0.6, 0.8) * t); },
                    .second_mass = 4};
    const double h = 1e-5;
    const auto run = hand_over(disc, Disc::W{0, 0}, {.t_end = 1 + h});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    const Disc::W rate = run.x / h;
    EXPECT_NEAR(rate.norm(), 0.228073260292, h);
    EXPECT_NEAR(rate[0] / rate.norm(), 0.824092893837, h);
    EXPECT_NEAR(rate[1] / rate.norm(), 0.566454678087, h);
}

/// The disc with a flow beside it.
struct BesideADisc {
    using State = std::array<double, 2>;
    Disc disc;
    void flow(double t, const State& x, State& dxdt) const
    {
        const Disc::W f = disc.load(t), v(x[0], x[1]);
        const Disc::W force = f - disc.kinetic * v / std::max(v.norm(), 1e-300);
        dxdt = {force[0], force[1] / disc.second_mass};
    }
    [[nodiscard]] Disc set_valued() const { return disc; }
};

TEST(StaticFriction, ADiscBesideAFlowSlipsAsItDoesAlone)
{
    using Two = BesideADisc::State;
    const auto load = [](double t) { return Disc::W(Disc::W(0.6, 0.8) * t); };
    const auto slow = [](double t) { return Disc::W(Disc::W(0.6, 0.8) * t / 5); };
    const double h = 1e-5, rate = 0.228073260292;
    expect_end(run_of(BesideADisc{{.load = slow}}, Two{0, 0}, until(6)), Two{0.36, 0.48}, of_steps);
    const BesideADisc unequal{{.load = load, .second_mass = 4}};
    const auto run = run_of(unequal, Two{0, 0}, until(1 + h));
    const Two along{0.824092893837 * rate, 0.566454678087 * rate};
    expect_end(run, Two{along[0] * h, along[1] * h}, h * h);
}

TEST(StaticFriction, ADiscIsHeldWhereItStopsUnderALoadBetweenItsBounds)
{
    // Against the load 0.7: v' = 0.7 + 0.5 from -1.2, at rest at 1, where the kinetic law would
    // carry it on.
    const Disc disc{.load = [](double) { return Disc::W(Disc::W(0.6, 0.8) * 0.7); }};
    const auto run = hand_over(disc, Disc::W{-0.72, -0.96}, {.t_end = 3});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_LT(run.x.norm(), 1e-12);
    EXPECT_NEAR(std::hypot(run.reaction[0], run.reaction[1]), 0.7, 1e-12);
    // Above the static bound it turns: v' = 1.1 - 0.5 after the stop at 1 from 1.6.
    const Disc pulled{.load = [](double) { return Disc::W(Disc::W(0.6, 0.8) * 1.1); }};
    const auto turned = hand_over(pulled, Disc::W{-0.96, -1.28}, {.t_end = 2});
    EXPECT_NEAR(turned.x.norm(), 0.6, of_steps);
}

TEST(StaticFriction, ADiscThatStartsAtRestIsHeldUpToItsStaticBound)
{
    for (const double load : {0.51, 0.7, 0.99, 1.0}) {
        const Disc disc{.load = [load](double) { return Disc::W(Disc::W(0.6, 0.8) * load); }};
        EXPECT_EQ(hand_over(disc, Disc::W{0, 0}, {.t_end = 3}).x, Disc::W(0, 0)) << load;
    }
    const Disc beyond{.load = [](double) { return Disc::W(0.66, 0.88); }};  // 1.1
    EXPECT_NEAR(hand_over(beyond, Disc::W{0, 0}, {.t_end = 3}).x.norm(), 0.6 * 3, of_steps);
}

TEST(StaticFriction, ADiscIsHeldWhereverInAStepItStops)
{
    // v' = 0.7 + 0.5 against the load, in steps of 3 ms: at the end of a step, and by any distance
    // before and behind it.
    const Disc disc{.load = [](double) { return Disc::W(0.7, 0); }};
    for (const int steps : {1, 4, 20, 33}) {
        for (const double off : {0.0, 1e-15, 1e-13, 1e-11, 1e-10, 3e-9, 1e-8, 1e-7, 1e-5, 0.3}) {
            for (const double sign : {-1, 1}) {
                const double v = -0.0036 * steps * (1 + sign * off);
                const auto run = hand_over(disc, Disc::W{v, 0}, {.t_end = 3});
                ASSERT_EQ(run.outcome, Outcome::reached_end);
                EXPECT_LT(run.x.norm(), 1e-12) << steps << ' ' << sign * off;
            }
        }
    }
}

/// A disc whose velocity is set at 1.
struct KickedDisc : BesideADisc {
    Disc::W to;
    [[nodiscard]] static double next_time_event(double t)
    {
        return t < 1 ? 1 : std::numeric_limits<double>::infinity();
    }
    void time_reset(double, State& x) const { x = {to[0], to[1]}; }
};

TEST(StaticFriction, ADiscThatIsKickedSlidesAndOneThatIsStoppedIsHeld)
{
    using Two = KickedDisc::State;
    const auto with = [](double load, double at_rest, Disc::W to) {
        return KickedDisc{
            {Disc{.load = [load](double) { return Disc::W(load, 0); }, .at_rest = at_rest}}, to};
    };
    // From 5 with the rate -1/2 over 2 s; an impulse of 1e-9 stops within 2e-9 s.
    for (const double at_rest : {0.5, 0.75, 1.0}) {
        expect_end(run_of(with(0, at_rest, {5, 0}), Two{0, 0}, until(3)), Two{4, 0}, of_steps);
        expect_end(run_of(with(0, at_rest, {1e-9, 0}), Two{0, 0}, until(3)), Two{0, 0});
    }
    // Stopped under a load between the bounds it is held, under one above them it goes on.
    expect_end(run_of(with(0.7, 1, {0, 0}), Two{1, 0}, until(3)), Two{0, 0});
    expect_end(run_of(with(1.1, 1, {0, 0}), Two{1, 0}, until(3)), Two{1.2, 0}, of_steps);
}

TEST(StaticFriction, ADiscStopsUnderASmallLoadAndSlipsAgain)
{
    // v' = (t - 3)/2 - 1/2 from 1 against a load that turns: at rest where (t - 4)^2 / 4 = 3, held
    // until the load (t - 3)/2 is 1 at 5, then v' = (t - 4)/2: 3/4 at 6.
    const Disc disc{.load = [](double t) { return Disc::W(Disc::W(0.8, -0.6) * (t - 3) / 2); }};
    const auto run = hand_over(disc, Disc::W(0.8, -0.6), {.t_end = 6});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 0.8 * 0.75, of_steps);
    EXPECT_NEAR(run.x[1], -0.6 * 0.75, of_steps);
}

TEST(StaticFriction, ALoadThatRestsAtTheStaticBoundOfADiscMovesNothing)
{
    const Disc disc{.load = [](double t) { return Disc::W(0, std::min(t, 1.0)); }};
    EXPECT_EQ(hand_over(disc, Disc::W{0, 0}, {.t_end = 2}).x, Disc::W(0, 0));
    const Disc above{.load = [](double t) { return Disc::W(0, std::min(t, 1 + 1e-6)); }};
    EXPECT_NEAR(hand_over(above, Disc::W{0, 0}, {.t_end = 2}).x[1], 0.500001, 1e-6);
}

/// The same body as a phase of a run beside a ball that falls on an elastic floor at g = 1; a tick
/// at 2 does nothing.
struct DiscBesideABall {
    using State = std::array<double, 4>;
    struct Motion {
        static constexpr int state_size = 4, reaction_size = 2;
        using W = Eigen::Vector4d;
        static void smooth(double t, const W& w, W& f) { f << 0.6 * t / 5, 0.8 * t / 5, w[3], -1; }
        [[nodiscard]] static sets::Ball<2> reaction_set(double, const W&)
        {
            return sets::Ball<2>(0.5);
        }
        [[nodiscard]] static double static_bound(double, const W&, int) { return 1; }
    };
    static void flow(double t, const State& x, State& dxdt)
    {
        const double speed = std::hypot(x[0], x[1]);
        dxdt = {0.6 * t / 5 - 0.5 * x[0] / speed, 0.8 * t / 5 - 0.5 * x[1] / speed, x[3], -1};
    }
    [[nodiscard]] static double guard(double, const State& x) { return x[2]; }
    [[nodiscard]] static GuardInfo guard_info() { return {.unilateral = true}; }
    static void reset(double, State& x) { x[3] = -x[3]; }
    [[nodiscard]] static double next_time_event(double t) { return t < 2 ? 2 : never; }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(StaticFriction, ADiscSlipsBesideOtherEventsAndThroughSnapshots)
{
    // Impacts of the ball from 1.125: 1.5 and 4.5.
    const Options options{.t_end = 6, .rtol = 1e-10, .atol = 1e-10};
    const DiscBesideABall::State x0{0, 0, 1.125, 0};
    const auto run = integrate(DiscBesideABall{}, x0, options);
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    const DiscBesideABall::State end{0.36, 0.48, 1.125, 0};
    for (std::size_t i = 0; i < end.size(); ++i) EXPECT_NEAR(run.x[i], end[i], of_steps) << i;
    ASSERT_EQ(run.events.size(), 3U);
    EXPECT_NEAR(run.events[0].t, 1.5, 1e-12);
    EXPECT_NEAR(run.events[2].t, 4.5, 1e-12);

    Simulation simulation(DiscBesideABall{}, x0, options);
    Simulation other(DiscBesideABall{}, x0, options);
    for (int step = 0; simulation.step(); ++step) {
        if (step % 10 != 0) continue;
        other.restore(simulation.save());
        simulation.restore(other.save());
    }
    EXPECT_EQ(simulation.x(), run.x);
}

/// Two bodies, each with a disc: kinetic 1/2, static 1 and 2.
struct TwoDiscs {
    static constexpr int state_size = 4, reaction_size = 4;
    using W = Eigen::Vector4d;
    static void smooth(double t, const W&, W& f) { f << t, 0, 0.4 * t, 0; }
    [[nodiscard]] static auto reaction_set(double, const W&)
    {
        return sets::Product(sets::Ball<2>(0.5), sets::Ball<2>(0.5));
    }
    [[nodiscard]] static double static_bound(double, const W&, int i) { return i == 0 ? 1 : 2; }
};

TEST(StaticFriction, DiscsAreHeldEachByItself)
{
    // The first slips at 1, and moves by (t - 1/2)^2 / 2 after it; the second at 5.
    const auto run = hand_over(TwoDiscs{}, TwoDiscs::W::Zero(), {.t_end = 6});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], (5.5 * 5.5 - 0.5 * 0.5) / 2, of_steps);
    EXPECT_NEAR(run.x[2], 0.2 * (36 - 25) - 0.5, of_steps);
    EXPECT_EQ(run.x[1], 0);
}

TEST(StaticFriction, AStaticBoundOfADiscBelowItsKineticOneIsRefused)
{
    const Disc disc{.load = [](double) { return Disc::W(1, 0); }, .at_rest = 0.4};
    try {
        (void)hand_over(disc, Disc::W(0, 0), {.t_end = 1});
        FAIL() << "not refused";
    } catch (const std::invalid_argument& error) {
        const std::string text = error.what();
        EXPECT_NE(text.find("static bound"), std::string::npos) << text;
        EXPECT_NE(text.find("0.4"), std::string::npos) << text;
        EXPECT_NE(text.find("0.5"), std::string::npos) << text;
    }
}

}  // namespace
}  // namespace ricochet::static_friction_test
