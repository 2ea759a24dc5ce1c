// The branches of an inclusion as modes, and the check that a step followed the held reactions, by
// themselves: a block of 1 kg that is pulled by a load and rubs with friction 1 N,
//
//     v' = load(t) + r,   r in [-1, 1] against v,
//
// and two such blocks, of which one rubs on the other.

#include "ricochet/nonsmooth/branch_modes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "ricochet/nonsmooth/detail/held_reactions.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet {
namespace {

using Modes = detail::AnyModes<1, 1>;
using Vector1 = Eigen::Matrix<double, 1, 1>;
constexpr Mode forwards = 0, held = 1, backwards = 2;  // y > 0, y = 0, y < 0
constexpr std::size_t falls = 0, rises = 1, at_lower = 2, at_upper = 3, is_set = 4;

struct Block {
    static constexpr int state_size = 1;
    static constexpr int reaction_size = 1;
    std::function<double(double)> load = [](double) { return 0.0; };

    void smooth(double t, const Vector1& /*w*/, Vector1& f) const { f[0] = load(t); }
    [[nodiscard]] static sets::IntervalSet reaction_set(double /*t*/, const Vector1& /*w*/)
    {
        return sets::IntervalSet::symmetric(1);
    }
};

Block pulled_by(double load)
{
    return {[=](double) { return load; }};
}
Mode start(const Block& block, double v)
{
    Vector1 w(v);
    return BranchModes<Block>(block).mode_at(0, w);
}

TEST(BranchModes, TheSideOfYIsTheBranch)
{
    EXPECT_EQ(start(pulled_by(0.5), 2), forwards);
    EXPECT_EQ(start(pulled_by(0.5), -2), backwards);
}

TEST(BranchModes, AtZeroTheLoadDecides)
{
    EXPECT_EQ(start(pulled_by(0.5), 0), held);
    EXPECT_EQ(start(pulled_by(1.5), 0), forwards);
    EXPECT_EQ(start(pulled_by(-1.5), 0), backwards);
}

TEST(BranchModes, AtItsBoundTheCurvatureDecides)
{
    // y'' is the load's rate: it leaves where the load goes on to rise, and is held where it falls.
    EXPECT_EQ(start({[](double t) { return 1 + t; }}, 0), forwards);
    EXPECT_EQ(start({[](double t) { return 1 - t; }}, 0), held);
    EXPECT_EQ(start({[](double t) { return -1 - t; }}, 0), backwards);
}

TEST(BranchModes, FlowIsThatOfTheBranch)
{
    const BranchModes<Block> modes(pulled_by(0.5));
    Modes::State rate{};
    modes.flow(forwards, 0, {3}, rate);
    EXPECT_EQ(rate[0], -0.5);
    modes.flow(backwards, 0, {-3}, rate);
    EXPECT_EQ(rate[0], 1.5);
    modes.flow(held, 0, {0}, rate);
    EXPECT_EQ(rate[0], 0);
    EXPECT_EQ(modes.reaction(held, 0, Vector1(0.0))[0], -0.5);
}

TEST(BranchModes, GuardsAreTheDistancesToTheEndsOfABranch)
{
    const BranchModes<Block> modes(pulled_by(0.25));
    EXPECT_EQ(modes.guard(falls, forwards, 0, {3}), 3);
    EXPECT_EQ(modes.guard(rises, backwards, 0, {-3}), 3);
    EXPECT_EQ(modes.guard(at_lower, held, 0, {0}), 0.75);  // the reaction is -0.25
    EXPECT_EQ(modes.guard(at_upper, held, 0, {0}), 1.25);
    EXPECT_EQ(modes.guard(is_set, held, 0, {0}), 1);
    EXPECT_TRUE(modes.enabled(falls, forwards));
    EXPECT_FALSE(modes.enabled(falls, held));
    EXPECT_FALSE(modes.enabled(at_lower, forwards));
    EXPECT_FALSE(modes.enabled(falls, Modes::several));
}

TEST(BranchModes, RatesOfGuardsFollowTheLoad)
{
    const BranchModes<Block> modes({[](double t) { return 0.25 * t; }});
    const Modes::State x{0}, rate{0};
    // A difference over 1e-5 of a second rounds to 1e-11 of the distances, which are of order 1.
    EXPECT_NEAR(modes.guard_rate(at_lower, held, 1, x, rate), -0.25, 1e-10);
    EXPECT_NEAR(modes.guard_rate(at_upper, held, 1, x, rate), 0.25, 1e-10);
    EXPECT_EQ(modes.guard_rate(falls, forwards, 1, {2}, {-0.75}), -0.75);
}

TEST(BranchModes, AnArrivalIsHeldOrPassesThrough)
{
    const auto after = [](double load) {
        const BranchModes<Block> modes(pulled_by(load));
        const std::size_t fired[] = {falls};
        Modes::State x{1e-17};
        return modes.reset(FiredGuards(fired, false), forwards, 0, x);
    };
    EXPECT_EQ(after(0.5), held);
    EXPECT_EQ(after(-0.5), held);
    EXPECT_EQ(after(-1.5), backwards);
}

TEST(BranchModes, ALeftBoundGoesToItsSide)
{
    const BranchModes<Block> modes(pulled_by(1.5));
    const std::size_t fired[] = {at_lower};
    Modes::State x{0};
    EXPECT_EQ(modes.reset(FiredGuards(fired, false), held, 0, x), forwards);
}

struct Inverted : Block {
    [[nodiscard]] static sets::IntervalSet reaction_set(double /*t*/, const Vector1& /*w*/)
    {
        return {1, -1};
    }
};

TEST(BranchModes, BoundsThatFormNoIntervalAreEmpty)
{
    const BranchModes<Inverted> modes(Inverted{});
    Vector1 w(0.0);
    EXPECT_EQ(modes.arrive(Modes::branches_of(held), 0, w), Modes::empty);
    EXPECT_EQ(modes.guard(is_set, held, 0, {0}), -1);
}

/// w = (x1, x2, v1, v2): the first rubs on the ground, the second on the first, with 1 N each.
struct TwoBlocks {
    static constexpr int state_size = 4;
    static constexpr int reaction_size = 2;
    double pull = 0;  ///< [N] on the second

    void smooth(double /*t*/, const Eigen::Vector4d& w, Eigen::Vector4d& f) const
    {
        f << w[2], w[3], 0, pull;
    }
    static void observe(Eigen::Matrix<double, 2, 4>& e) { e << 0, 0, 1, 0, 0, 0, -1, 1; }
    static void act(Eigen::Matrix<double, 4, 2>& g) { g << 0, 0, 0, 0, 1, -1, 0, 1; }
    [[nodiscard]] static auto reaction_set(double /*t*/, const Eigen::Vector4d& /*w*/)
    {
        return sets::Box<2>({-2, -1}, {2, 1});
    }
};

TEST(BranchModes, ReactionsThatDependOnEachOtherAreHeldTogether)
{
    const BranchModes<TwoBlocks> modes(TwoBlocks{.pull = 0.5});
    Eigen::Vector4d w(0, 0, 0, 0);
    const Mode both = modes.mode_at(0, w);
    EXPECT_EQ(both, held + 3 * held);
    const auto r = modes.reaction(both, 0, w);
    EXPECT_DOUBLE_EQ(r[0], -0.5);  // the ground bears what the upper block is pulled with
    EXPECT_DOUBLE_EQ(r[1], -0.5);

    // Pulled harder than its friction, the upper one slides, and the lower one bears that friction.
    const BranchModes<TwoBlocks> pulled(TwoBlocks{.pull = 1.5});
    const Mode upper = pulled.mode_at(0, w);
    EXPECT_EQ(upper, held + 3 * forwards);
    EXPECT_DOUBLE_EQ(pulled.reaction(upper, 0, w)[0], -1);
}

// --- held reactions ---

/// The fraction of a step from t0 to t1, in which the block stands, that would follow its reaction.
double fraction_of(const Modes& modes, detail::HeldReactions<1, 1>& reactions, double t0, double t1)
{
    const Vector1 w(0.0);
    Modes::Motion motion;
    Modes::Rooms rooms;
    modes.rooms(held, t1, w, motion, rooms);
    return reactions.fraction(modes, {held, t0, t1, w, w, 0}, motion.rate, rooms);
}
double fraction_of(const Block& block, double t0, double t1)
{
    const BranchModes<Block> modes(block);
    detail::HeldReactions<1, 1> reactions;
    return fraction_of(modes, reactions, t0, t1);
}

TEST(HeldReactions, AReactionInsideItsBoundsIsFollowed)
{
    EXPECT_EQ(fraction_of(pulled_by(0.9), 0, 100), 1);
    EXPECT_EQ(fraction_of({[](double t) { return 0.9 * t; }}, 0, 1), 1);
}

TEST(HeldReactions, AnExcursionBeyondTheBoundIsSeenFromInside)
{
    // The load is 0.5 at both ends and 1.5 between them.
    const auto bump = [](double t) { return 0.5 + std::sin(3.141592653589793 * t); };
    EXPECT_LT(fraction_of({bump}, 0, 1), 1);
    // Steps that the fraction shortens end before the bound is passed, at asin(0.5) / pi = 1/6.
    double h = 1;
    for (double part = 0; (part = fraction_of({bump}, 0, h)) < 1;) h *= part;
    EXPECT_LT(h, 1.0 / 6);
    EXPECT_GT(h, 1.0 / 60);  // a fraction is at least a tenth of what follows the reaction
}

TEST(HeldReactions, OneThatStartsBeyondItsBoundIsNamed)
{
    const BranchModes<Block> modes(pulled_by(1.25));
    detail::HeldReactions<1, 1> reactions;
    (void)fraction_of(modes, reactions, 0, 1);
    EXPECT_TRUE(reactions.starts_beyond());
}

}  // namespace
}  // namespace ricochet
