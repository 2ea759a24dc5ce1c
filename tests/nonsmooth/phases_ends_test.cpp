// Runs with phases that end because the inclusion does not say how the motion goes on, or says
// something else than the flow. Tolerances as in phased_runs.hpp.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "automata.hpp"
#include "phased_runs.hpp"
#include "refusal.hpp"

namespace ricochet::phases_ends_test {
namespace {

using One = std::array<double, 1>;
using Two = std::array<double, 2>;

/// w' = F + Sgn w: the reaction pushes w away from zero.
struct Repulsive {
    using State = One;
    double load;

    struct Motion {
        static constexpr int state_size = 1, reaction_size = 1;
        using Vector = Eigen::Matrix<double, 1, 1>;
        double load;

        void smooth(double, const Vector&, Vector& f) const { f[0] = load; }
        static void act(Eigen::Matrix<double, 1, 1>& g) { g << -1; }
        [[nodiscard]] static sets::Box<1> reaction_set(double, const Vector&)
        {
            return sets::Box<1>({-1}, {1});
        }
    };
    void flow(double, const State& x, State& dxdt) const { dxdt[0] = load + (x[0] >= 0 ? 1 : -1); }
    [[nodiscard]] Motion set_valued() const { return {load}; }
};

TEST(PhasesEnds, ARepulsiveReactionIsCrossedWhereOneMotionIsLeft)
{
    const auto run = run_of(Repulsive{3}, One{-1}, until(1));
    expect_end(run, One{2});
    expect_times(times_of(run.events, EventKind::mode), {0.5});
    expect_end(run_of(Repulsive{3}, One{0}, until(1)), One{4});
}

TEST(PhasesEnds, SeveralMotionsFromOneStateEndTheRunNamingTheReaction)
{
    for (const double load : {0.0, 0.5, -0.5}) {
        const auto run = run_of(Repulsive{load}, One{0}, until(1));
        EXPECT_EQ(run.outcome, Outcome::several) << load;
        EXPECT_EQ(run.t, 0);
        EXPECT_EQ(run.reason,
                  "where its y is zero, reaction 0 may hold it or let it leave to either side");
    }
}

TEST(PhasesEnds, SeveralMotionsEndARunOfTheInclusionAloneToo)
{
    const Repulsive::Motion motion{0};
    const auto run = hand_over(motion, Repulsive::Motion::Vector::Zero(), {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::several);
    EXPECT_EQ(run.t, 0);
    const auto passed =
        hand_over(Repulsive::Motion{3}, Repulsive::Motion::Vector::Zero(), {.t_end = 1});
    EXPECT_EQ(passed.outcome, Outcome::reached_end);
    EXPECT_NEAR(passed.x[0], 4, exact_motion);
}

/// A block that friction holds, until its speed is set to something that is no number at 1.
struct SpoiltAtOne {
    using State = One;
    struct Friction {
        static constexpr int state_size = 1, reaction_size = 1;
        using Vector = Eigen::Matrix<double, 1, 1>;
        static void smooth(double, const Vector&, Vector& f) { f[0] = 0.5; }
        [[nodiscard]] static sets::Box<1> reaction_set(double, const Vector&)
        {
            return sets::Box<1>({-1}, {1});
        }
    };
    static void flow(double, const State& x, State& dxdt)
    {
        dxdt[0] = 0.5 + (x[0] > 0 ? -1 : x[0] < 0 ? 1 : 0);
    }
    static double next_time_event(double t)
    {
        return t < 1 ? 1 : std::numeric_limits<double>::infinity();
    }
    static void time_reset(double, State& x) { x[0] = std::numeric_limits<double>::quiet_NaN(); }
    static Friction set_valued() { return {}; }
};

TEST(PhasesEnds, AResetThatIsNoNumberReleasesNothing)
{
    const auto run = integrate(SpoiltAtOne{}, One{0}, until(2));
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_EQ(run.t, 1);
    EXPECT_EQ(times_of(run.events, EventKind::slip).size(), 0u);
}

// --- sets that are faulty at the start, where the system's own flow is followed ---

/// w_i' = -Sgn w_i with given bounds of the last reaction.
template <int N>
struct Bounded {
    using State = std::array<double, N>;
    double lower, upper;

    struct Motion {
        static constexpr int state_size = N, reaction_size = N;
        using Vector = Eigen::Matrix<double, N, 1>;
        double lower, upper;

        static void smooth(double, const Vector&, Vector& f) { f.setZero(); }
        [[nodiscard]] sets::Box<N> reaction_set(double, const Vector&) const
        {
            std::array<double, N> low, high;
            low.fill(-1);
            high.fill(1);
            low.back() = lower;
            high.back() = upper;
            return sets::Box<N>(low, high);
        }
    };
    static void flow(double, const State& x, State& dxdt)
    {
        for (std::size_t i = 0; i < N; ++i) dxdt[i] = x[i] >= 0 ? -1 : 1;
    }
    [[nodiscard]] Motion set_valued() const { return {lower, upper}; }
};

TEST(PhasesEnds, ABoundThatIsNoNumberIsRefusedAtTheStart)
{
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(refusal([] {
                  (void)integrate(Bounded<2>{-1, nan}, Two{1, 1}, until(3));
              }),
              "integrate: at the start the bounds of reaction 1 are -1 and nan; expected numbers, "
              "the lower one first");
}

TEST(PhasesEnds, AnEmptySetIsRefusedAtTheStart)
{
    EXPECT_EQ(
        refusal([] {
            (void)integrate(Bounded<2>{1, -1}, Two{1, 1}, until(3));
        }),
        "integrate: at the start the bounds of reaction 1 are 1 and -1; expected numbers, the "
        "lower one first");
}

/// A block, and a contact whose cone of friction is given.
struct Sliding {
    using State = std::array<double, 2>;
    double friction;

    struct Motion {
        static constexpr int state_size = 2, reaction_size = 2;
        double friction;
        static void smooth(double, const Eigen::Vector2d&, Eigen::Vector2d& f) { f << -1, 0; }
        [[nodiscard]] sets::FrictionCone<2> reaction_set(double, const Eigen::Vector2d&) const
        {
            return sets::FrictionCone<2>(friction);
        }
    };
    static void flow(double, const State&, State& dxdt) { dxdt = {-1, 0}; }
    [[nodiscard]] Motion set_valued() const { return {friction}; }
};

TEST(PhasesEnds, ASetWithoutBranchesThatIsFaultyIsRefusedAtTheStart)
{
    EXPECT_EQ(refusal([] {
                  (void)integrate(Sliding{-1}, Two{1, 1}, until(0.5));
              }),
              "integrate: at the start the set has a negative coefficient of friction");
    EXPECT_EQ(refusal([] { (void)integrate(Sliding{0.5}, Two{1, 1}, until(0.5)); }), "accepted");
}

/// A block whose flow knows a part of the friction alone.
struct Forgetful : Slider<1> {
    double known = 0.5;

    void flow(double t, const State& x, State& dxdt) const
    {
        f(t, x, dxdt);
        dxdt[0] -= known * (x[0] >= 0 ? friction : -friction);
    }
};

TEST(PhasesEnds, AFlowThatIsNotThatOfTheInclusionEndsTheRunWhereItTakesOver)
{
    const Forgetful system{{.f = [](double, const One&, One& dxdt) { dxdt[0] = 0; }}};
    const auto run = run_of(system, One{1}, until(3));
    EXPECT_EQ(run.outcome, Outcome::law_violated);
    EXPECT_NEAR(run.t, 2, exact_motion);
    EXPECT_NE(run.reason.find("the flow gives component 0 the rate -0.5, and the inclusion -1"),
              std::string::npos)
        << run.reason;
}

TEST(PhasesEnds, AFlowThatIsNotThatOfTheInclusionIsSeenAtTheStartWhateverTheTolerance)
{
    // At rtol 1e-3 no y counts as clear of zero, and the flow is never followed.
    const Forgetful system{{.f = [](double, const One&, One& dxdt) { dxdt[0] = 0; }}};
    const Options loose{.t_end = 3, .rtol = 1e-3, .atol = 1e-6};
    const auto run = run_of(system, One{1}, loose);
    EXPECT_EQ(run.outcome, Outcome::law_violated);
    EXPECT_EQ(run.t, 0);
    EXPECT_EQ(run.reason,
              "where the inclusion decides at the start, at t = 0, the flow gives component 0 the "
              "rate -0.5, and the inclusion -1");
    const Slider<1> fine{.f = [](double, const One&, One& dxdt) { dxdt[0] = 0; }};
    expect_end(run_of(fine, One{1}, loose), One{0});
}

TEST(PhasesEnds, ABalanceOfLoadAndFrictionIsNoContradiction)
{
    // It slides with a rate of 1e-9, the difference of two terms of size 1.
    for (const double excess : {1e-9, 1e-13}) {
        const Slider<1> system{
            .f = [excess](double, const One&, One& dxdt) { dxdt[0] = 1 - excess; }};
        const auto run = run_of(system, One{excess / 2}, until(2));
        expect_end(run, One{0});
    }
}

}  // namespace
}  // namespace ricochet::phases_ends_test
