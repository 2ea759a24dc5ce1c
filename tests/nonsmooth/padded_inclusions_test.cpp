// A system has the same motion, to the last bit, in every compiled size that holds it.

#include "padded_inclusions.hpp"

#include "problems/incline_block.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::padded_inclusions_test {
namespace {

using test::compare;
using test::Dense;
using test::DenseInBall;
using test::DenseWithStops;

TEST(PaddedInclusions, OneComponent)
{
    const SlidingMode system;
    const SlidingMode::Vector w0(0.15);
    compare<1, 1, 2, 1>(system, w0, 0.5, 0.01);
    compare<1, 1, 4, 2>(system, w0, 0.5, 0.01);
    compare<1, 1, 8, 4>(system, w0, 0.5, 0.01);
}

TEST(PaddedInclusions, TwoComponents)
{
    const FrictionInclusion friction;
    const Eigen::Vector2d w0(1, 0.5);
    compare<2, 1, 3, 1>(friction, w0, 4, 0.05);
    compare<2, 1, 4, 2>(friction, w0, 4, 0.05);
    compare<2, 1, 8, 4>(friction, w0, 4, 0.05);
    compare<2, 1, 4, 2>(Dense<2, 1>{}, Dense<2, 1>::start(), 3, 0.05);
}

TEST(PaddedInclusions, ThreeComponents)
{
    compare<3, 1, 4, 2>(DiodeCircuit{}, DiodeCircuit::start(), 3, 0.01);
    compare<3, 1, 8, 4>(DiodeCircuit{}, DiodeCircuit::start(), 3, 0.01);
    compare<3, 1, 8, 4>(Dense<3, 1>{}, Dense<3, 1>::start(), 3, 0.05);
    compare<3, 1, 4, 2>(DenseInBall<3, 1>{}, Dense<3, 1>::start(), 2, 0.05);
    compare<3, 1, 8, 4>(DenseWithStops<3, 1>{}, DenseWithStops<3, 1>::start(), 2, 0.05);
}

TEST(PaddedInclusions, FixedPoints)
{
    SetValuedOptions options{.t_end = 2, .step = 0.01};
    options.scheme.stage = {.method = StageMethod::fixed_point, .tolerance = 1e-10};
    test::expect_same_steps<3, 1, 8, 4>(DiodeCircuit{}, DiodeCircuit::start(), options);
}

TEST(PaddedInclusions, FourComponentsAndTwoReactions)
{
    compare<4, 2, 8, 4>(Dense<4, 2>{}, Dense<4, 2>::start(), 3, 0.05);
    compare<4, 2, 8, 4>(DenseInBall<4, 2>{}, Dense<4, 2>::start(), 2, 0.05);
    compare<4, 2, 8, 4>(DenseWithStops<4, 2>{}, DenseWithStops<4, 2>::start(), 2, 0.05);
    compare<4, 2, 8, 4>(InclineBlock(), {1, 1, 0, 0}, 1, 0.01);
}

TEST(PaddedInclusions, RunInTheSmallestSizeThatHoldsThem)
{
    using detail::size_for;
    const auto is = [](detail::InclusionSize size, int n, int m) {
        return size.components == n && size.reactions == m;
    };
    EXPECT_TRUE(is(size_for<1, 1>(), 1, 1));
    EXPECT_TRUE(is(size_for<2, 1>(), 2, 1));
    EXPECT_TRUE(is(size_for<2, 2>(), 4, 2));
    EXPECT_TRUE(is(size_for<4, 1>(), 4, 2));
    EXPECT_TRUE(is(size_for<5, 2>(), 8, 4));
    EXPECT_TRUE(is(size_for<1, 3>(), 8, 4));
    EXPECT_TRUE(is(size_for<Eigen::Dynamic, Eigen::Dynamic>(), Eigen::Dynamic, Eigen::Dynamic));
}

TEST(PaddedInclusions, ModesAreThoseOfTheSystem)
{
    EXPECT_EQ((detail::resized_mode<1, 2>(2)), 2U);
    EXPECT_EQ((detail::resized_mode<1, 2>(9)), 3U);
    EXPECT_EQ((detail::resized_mode<2, 4>(81 + 2)), 9U + 2);
    EXPECT_EQ((detail::resized_mode<4, 4>(81)), 81U);
}

// --- what users see ---

using Five = Dense<5, 2>;

TEST(PaddedInclusions, ResultsHaveTheComponentsOfTheSystem)
{
    const auto run =
        hand_over(Five{}, Five::start(), {.t_end = 10, .rtol = 1e-8, .sample_times = {1, 2}});
    static_assert(std::is_same_v<std::remove_cvref_t<decltype(run.x)>, Five::Vector>);
    static_assert(std::is_same_v<std::remove_cvref_t<decltype(run.events[0].after)>, Five::Vector>);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.events.size(), 3U);
    EXPECT_EQ(run.trajectory.x.size(), 2U);
    for (const auto& event : run.events) EXPECT_LT(event.guard, 2U);
}

TEST(PaddedInclusions, ARunContinuesFromItsState)
{
    const auto first = hand_over(Five{}, Five::start(), {.t_end = 5, .rtol = 1e-8});
    const auto whole = hand_over(Five{}, Five::start(), {.t_end = 10, .rtol = 1e-8});
    const auto rest = HandOver<Five>(Five{}, first, {.t_end = 10, .rtol = 1e-8}).take();
    EXPECT_EQ(rest.outcome, Outcome::reached_end);
    // Two runs with other steps, each within 1e-8 of its size at every step, over a damped motion.
    EXPECT_LT((rest.x - whole.x).norm(), 1e-5);
}

TEST(PaddedInclusions, MotionsHaveTheStatesOfTheSystem)
{
    SetValuedMotion motion(Five{}, Five::start(), {.t_end = 1, .step = 0.01});
    int seen = 0;
    EXPECT_EQ(motion.run([&](const SetValuedState<Five>& now) { seen += now.w.size() == 5; }),
              Outcome::reached_end);
    EXPECT_EQ(seen, 101);
    const double middle = motion.before().w[0] + 0.5 * (motion.state().w[0] - motion.before().w[0]);
    const auto found = motion.locate([&](const auto& at) { return at.w[0] - middle; });
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->w[0], middle, 1e-12);
    SetValuedState<Five> at;
    EXPECT_TRUE(motion.stepper().take(motion.before(), 0.01, at).converged);
    EXPECT_NEAR((at.w - motion.state().w).norm(), 0, 1e-12);
    motion.restart(0.5, Five::start());
    EXPECT_EQ(motion.state().t, 0.5);
    EXPECT_EQ(motion.state().w, Five::start());
}

TEST(PaddedInclusions, OptionsCountTheComponentsOfTheSystem)
{
    SetValuedOptions options{.t_end = 1, .step = 0.01};
    options.fields = {{.first = 0, .count = 5}};
    EXPECT_NO_THROW(SetValuedMotion(Five{}, Five::start(), options));
    options.fields = {{.first = 4, .count = 2}};
    EXPECT_THROW(SetValuedMotion(Five{}, Five::start(), options), std::invalid_argument);
}

/// A mass of zero in the last component.
struct Singular : Five {
    void mass(Eigen::Matrix<double, 5, 5>& a) const { a(4, 4) = 0; }
};

/// A set of another dimension.
struct Misfit : DenseInBall<5, 2> {
    [[nodiscard]] sets::Ball<3> reaction_set(double, const Vector&) const
    {
        return sets::Ball<3>(1);
    }
};

template <class Call>
std::string message_of(const Call& call)
{
    try {
        call();
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

TEST(PaddedInclusions, MessagesCountThoseOfTheSystem)
{
    EXPECT_NE(message_of([] {
                  (void)hand_over(Singular{}, Five::start(), {.t_end = 1});
              }).find("rank is 4"),
              std::string::npos);
    EXPECT_NE(
        message_of([] { (void)hand_over(Misfit{}, Five::start(), {.t_end = 1}); }).find("not 3"),
        std::string::npos);
}

}  // namespace
}  // namespace ricochet::padded_inclusions_test
