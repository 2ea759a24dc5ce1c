// The check that a step followed the held reactions, by itself, on a block that stands and is
// pulled.

#include "ricochet/nonsmooth/detail/held_reactions.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "ricochet/nonsmooth/hand_over.hpp"
#include "rubbing_block.hpp"

namespace ricochet {
namespace {

using test::Block;
using test::pulled_by;
using Modes = detail::AnyModes<1, 1>;
using Vector1 = Block::Vector;
constexpr Mode held = 1;  // y = 0

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

TEST(HeldReactions, GoesOnFromTheStepBefore)
{
    // Steps of one length, one after the other, are compared at one place: the load is known at
    // their start. The same numbers follow where the last step is given instead.
    int calls = 0;
    const Block block{[&](double t) {
        ++calls;
        return 0.5 * std::sin(t);
    }};
    const BranchModes<Block> modes(block);
    detail::HeldReactions<1, 1> reactions;
    EXPECT_EQ(fraction_of(modes, reactions, 0, 0.25), 1);
    const int first = std::exchange(calls, 0);
    EXPECT_EQ(fraction_of(modes, reactions, 0.25, 0.5), 1);
    EXPECT_LT(calls, first);
    const double worst = reactions.worst();
    detail::HeldReactions<1, 1> resumed;
    resumed.resume(modes, held, 0.25, Vector1(0.0), 0.25, 0);
    EXPECT_EQ(fraction_of(modes, resumed, 0.25, 0.5), 1);
    EXPECT_NEAR(resumed.worst(), worst, 1e-6);  // the rate is differenced ahead, not back

    reactions.forget();  // as at the first step
    calls = 0;
    EXPECT_EQ(fraction_of(modes, reactions, 0.5, 0.75), 1);
    EXPECT_EQ(calls, first);
}

}  // namespace
}  // namespace ricochet
