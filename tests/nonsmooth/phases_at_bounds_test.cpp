// Reactions that are held exactly at their bound for a while. A run may let go of one later by 64
// roundings of the reaction, 1.4e-14 of it: by t = 1e-14^(1/p) where the load grows by t^p, and
// with another y only where kinetic friction is less than static friction.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <type_traits>

#include "phased_runs.hpp"

namespace ricochet::phases_at_bounds_test {
namespace {

/// v' = F(t) - R beside a clock, |R| <= kinetic.
struct Block {
    static constexpr int state_size = 2, reaction_size = 1;
    using W = Eigen::Vector2d;
    std::function<double(double)> load;
    double kinetic = 1, at_rest = 1;

    void smooth(double t, const W&, W& f) const { f << load(t), 1; }
    static void observe(Eigen::Matrix<double, 1, 2>& e) { e << 1, 0; }
    [[nodiscard]] sets::IntervalSet reaction_set(double, const W&) const
    {
        return sets::IntervalSet::symmetric(kinetic);
    }
};
struct StaticBlock : Block {
    [[nodiscard]] double static_bound(double, const W&, int) const { return at_rest; }
};

/// Beside a guard that is reached at 1.
template <class Inclusion>
struct Held {
    using State = std::array<double, 2>;
    Inclusion block;

    void flow(double t, const State& x, State& dxdt) const
    {
        const double k = block.kinetic;
        dxdt = {block.load(t) + (x[0] > 0 ? -k : x[0] < 0 ? k : 0), 1};
    }
    static double guard(double, const State& x) { return x[1] - 1; }
    static void reset(double, State&) {}
    [[nodiscard]] Inclusion set_valued() const { return block; }
};

struct Case {
    double bound;
    std::function<double(double)> beyond;  ///< load above the bound
    double slip, end, late;                ///< at t = 2 by the load above the bound alone; [s]
};

std::vector<Case> cases()
{
    std::vector<Case> out;
    for (const double bound : {1.0, 0.3}) {
        out.push_back({bound, [](double t) { return std::max(0.0, t - 1); }, 1, 0.5, 1e-13});
        out.push_back({bound, [](double t) { return std::pow(t - 1, 3); }, 1, 0.25, 5e-5});
        out.push_back(
            {bound, [](double t) { return std::pow(std::max(0.0, t - 1), 2); }, 1, 1.0 / 3, 5e-7});
        out.push_back({bound, [](double t) { return t * t * t; }, 0, 4, 5e-5});
    }
    return out;
}

template <class Inclusion>
Held<Inclusion> held(const Case& of)
{
    constexpr bool is_static = std::is_same_v<Inclusion, StaticBlock>;
    Held<Inclusion> out;
    out.block.load = [of](double t) { return of.bound + of.beyond(t); };
    out.block.kinetic = is_static ? of.bound / 2 : of.bound;
    out.block.at_rest = of.bound;
    return out;
}

template <class Run>
void expect_slip(const Run& run, const Case& of, double drop)
{
    const double end = of.end + drop * (2 - of.slip);
    expect_end(run, std::array<double, 2>{end, 2}, exact_motion + drop * of.late);
    double slip = std::numeric_limits<double>::quiet_NaN();
    for (const auto& event : run.events) {
        if (event.kind == EventKind::slip) slip = event.t;
    }
    EXPECT_NEAR(slip, of.slip, of.late);
}

TEST(PhasesAtBounds, AHeldReactionLeavesItsBoundWhereTheLoadDoes)
{
    for (const Case& of : cases()) {
        SCOPED_TRACE(of.bound);
        SCOPED_TRACE(of.late);
        const std::array<double, 2> x0{0, 0};
        const auto kinetic = held<Block>(of);
        const auto both = held<StaticBlock>(of);
        const double drop = of.bound / 2;
        expect_slip(run_of(kinetic, x0, until(2)), of, 0);
        expect_slip(run_of(both, x0, until(2)), of, drop);
        Options fixed = until(2);
        fixed.step = 0.0101;
        expect_slip(integrate(kinetic, x0, fixed, FixedStep<Rk4>{}), of, 0);
        expect_slip(integrate(both, x0, fixed, FixedStep<Rk4>{}), of, drop);
        expect_slip(integrate(both, x0, until(2), ErrorControlled<Fehlberg78>{}), of, drop);
        expect_slip(integrate(both, x0, until(2), ErrorControlled<Dopri5>{}, Ends{}, Bisection{}),
                    of, drop);
    }
}

TEST(PhasesAtBounds, AReactionThatComesToItsBoundAndStaysThereIsHeldUntilItLeaves)
{
    // The load grows to the bound until 1, stays there until 3, and goes on; or it turns back at 2,
    // and pulls the other way from 4 on.
    const std::array<double, 2> x0{0, 0};
    const auto stays = [](double t) { return std::min(t, 1.0) - 1 + std::max(0.0, t - 3); };
    const auto turns = [](double t) { return std::min(t, 1.0) - 1 - std::max(0.0, t - 2); };
    const auto expect = [&](const auto& system, double t_end, double end, double slip) {
        for (const double step : {0.0, 0.0101}) {
            Options options = until(t_end);
            options.step = step;
            const auto run = step > 0 ? integrate(system, x0, options, FixedStep<Rk4>{})
                                      : run_of(system, x0, options);
            expect_end(run, std::array<double, 2>{end, t_end});
            expect_times(times_of(run.events, EventKind::slip), {slip});
            EXPECT_EQ(times_of(run.events, EventKind::stick).size(), 0u);
        }
    };
    expect(held<Block>({1, stays, 0, 0, 0}), 4, 0.5, 3);
    expect(held<Block>({1, turns, 0, 0, 0}), 5, -0.5, 4);
    expect(held<StaticBlock>({1, stays, 0, 0, 0}), 4, 1, 3);
    expect(held<StaticBlock>({1, turns, 0, 0, 0}), 5, -1, 4);
}

/// Held since 0 under a load that is beyond its bound from 0.4 to 1.2, and jumps beyond it at 1.8.
/// A step from 0 to the jump shows the load after it.
struct JumpsAtTheEnd {
    using State = std::array<double, 1>;
    static constexpr double jump = 1.8;
    static double load(double t) { return t < jump ? 1.2 - 1.25 * (t - 0.8) * (t - 0.8) : 1.5; }
    struct Friction {
        static constexpr int state_size = 1, reaction_size = 1;
        using W = Eigen::Matrix<double, 1, 1>;
        static void smooth(double t, const W&, W& f) { f[0] = load(t); }
        [[nodiscard]] static sets::IntervalSet reaction_set(double, const W&)
        {
            return sets::IntervalSet::symmetric(1);
        }
    };
    static void flow(double t, const State& x, State& dxdt)
    {
        dxdt[0] = load(t) + (x[0] > 0 ? -1 : x[0] < 0 ? 1 : 0);
    }
    static double next_time_event(double t)
    {
        return t < jump ? jump : std::numeric_limits<double>::infinity();
    }
    static Friction set_valued() { return {}; }
};

TEST(PhasesAtBounds, AStepThatEndsAtAJumpOfTheLoadIsJudgedBeforeIt)
{
    // With s = t - 0.8 it has the speed 0.2 (s + 0.4) - 1.25 (s^3 + 0.064) / 3 until s = 0.8.
    const auto far = [](const auto& stepping, double h_max) {
        Options options = until(2);
        options.h_max = h_max;
        return integrate(JumpsAtTheEnd{}, {0}, options, stepping);
    };
    const auto expected = far(ErrorControlled<Dopri5>{}, 1e-2);
    ASSERT_EQ(times_of(expected.events, EventKind::slip).size(), 2u);
    EXPECT_NEAR(times_of(expected.events, EventKind::slip)[0], 0.4, 1e-12);
    EXPECT_NEAR(times_of(expected.events, EventKind::stick)[0], 1.6, 1e-9);
    EXPECT_NEAR(expected.x[0], 0.1, 1e-9);
    for (const double h_max : {10.0, 1.8, 0.7}) {
        const auto run = far(ErrorControlled<Fehlberg78>{}, h_max);
        expect_end(run, expected.x);
        expect_times(times_of(run.events, EventKind::slip), {0.4, 1.8});
        expect_end(far(ErrorControlled<Dopri5>{}, h_max), expected.x);
    }
}

// The load passes the bound three times in a step as long as the run.
TEST(PhasesAtBounds, TheFirstOfSeveralExitsInAStepIsFound)
{
    const auto swings = [](double t) { return 1.3 * std::sin(5 * t) - 1; };
    const double first = std::asin(1 / 1.3) / 5;
    for (const double h_max : {10.0, 1.8, 1.6, 0.3}) {
        Options options = until(1.8);
        options.h_max = h_max;
        const auto f78 = integrate(held<Block>({1, swings, 0, 0, 0}), {0, 0}, options,
                                   ErrorControlled<Fehlberg78>{});
        const auto dopri5 = integrate(held<Block>({1, swings, 0, 0, 0}), {0, 0}, options);
        expect_end(f78, dopri5.x);
        EXPECT_NEAR(times_of(f78.events, EventKind::slip)[0], first, 1e-12);
        EXPECT_NEAR(times_of(dopri5.events, EventKind::slip)[0], first, 1e-12);
    }
}

TEST(PhasesAtBounds, AReactionThatStaysAtItsBoundOrTurnsBackIsHeld)
{
    const std::array<double, 2> x0{0, 0};
    for (const double bound : {1.0, 0.3}) {
        for (const double depth : {0.0, 0.1}) {
            const auto below = [depth](double t) { return -depth * std::pow(std::sin(5 * t), 2); };
            const Case of{bound, below, 0, 0, 0};
            expect_end(run_of(held<Block>(of), x0, until(2)), std::array<double, 2>{0, 2});
            const auto run = run_of(held<StaticBlock>(of), x0, until(2));
            expect_end(run, std::array<double, 2>{0, 2});
            EXPECT_EQ(times_of(run.events, EventKind::slip).size(), 0u);
        }
    }
}

}  // namespace
}  // namespace ricochet::phases_at_bounds_test
