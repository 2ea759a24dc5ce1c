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
