// The branches of an inclusion as modes, by themselves: of a block that rubs on the ground, and of
// two such blocks, of which one rubs on the other.

#include "ricochet/nonsmooth/branch_modes.hpp"

#include <gtest/gtest.h>

#include <array>

#include "ricochet/nonsmooth/hand_over.hpp"
#include "rubbing_block.hpp"

namespace ricochet {
namespace {

using Modes = detail::AnyModes<1, 1>;
using test::Block;
using test::pulled_by;
using Vector1 = Block::Vector;
constexpr Mode forwards = 0, held = 1, backwards = 2;  // y > 0, y = 0, y < 0
constexpr std::size_t falls = 0, rises = 1, at_lower = 2, at_upper = 3, is_set = 4;

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

TEST(BranchModes, AllGuardsTogetherAreThoseOneByOne)
{
    using Pair = detail::AnyModes<4, 2>;
    const BranchModes<TwoBlocks> modes(TwoBlocks{.pull = 0.5});
    const Pair::State x{0, 0, 2, 1}, rate{2, 1, -0.25, 0.75};
    for (Mode mode = 0; mode < Pair::branch_modes; ++mode) {
        std::array<double, Pair::guard_count> all{}, rates{};
        modes.guards(mode, 0, x, all);
        modes.guard_rates(mode, 0, x, rate, rates);
        for (std::size_t i = 0; i < Pair::guard_count; ++i) {
            if (!modes.enabled(i, mode)) continue;
            EXPECT_EQ(all[i], modes.guard(i, mode, 0, x)) << mode << ' ' << i;
            EXPECT_EQ(rates[i], modes.guard_rate(i, mode, 0, x, rate)) << mode << ' ' << i;
        }
        EXPECT_EQ(Pair::mode_of(Pair::branches_of(mode)), mode);
    }
}

TEST(BranchModes, AnArrivalWhereAnotherOneLeavesItsBoundIsNotDecided)
{
    using Pair = detail::AnyModes<4, 2>;
    const BranchModes<TwoBlocks> modes(TwoBlocks{.pull = 1.5});
    const Mode mode = held + 3 * forwards;  // the lower block stands, the upper one slides
    constexpr std::size_t upper_falls = 4 + falls;
    Pair::State x{0, 0, 0, 1e-17};
    const std::size_t leaves[] = {at_lower}, arrives[] = {upper_falls},
                      both[] = {at_lower, upper_falls};
    EXPECT_EQ(modes.reset(FiredGuards(both, false), mode, 0, x), Pair::several);
    x = {0, 0, 0, 1};
    EXPECT_EQ(modes.reset(FiredGuards(leaves, false), mode, 0, x), forwards + 3 * forwards);
    x = {0, 0, 0, 1e-17};
    EXPECT_NE(modes.reset(FiredGuards(arrives, false), mode, 0, x), Pair::several);
}

}  // namespace
}  // namespace ricochet
