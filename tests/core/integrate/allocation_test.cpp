// Nothing is allocated between the start and the end of a run.

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "allocations.hpp"
#include "problems/cave_body.hpp"
#include "problems/cavern.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/planar_arm.hpp"
#include "problems/zones.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::allocation_test {
namespace {

TEST(Allocation, TheCounterCounts)
{
    const auto before = testing_support::allocations();
    ::operator delete(::operator new(8));  // called by name, it is not elided
    EXPECT_EQ(testing_support::allocations() - before, 1u);
}

template <class Stepping, class Detector, class Locator>
void expect_none(const Options& options, const Detector& detector, const Locator& locator)
{
    const BouncingBall ball;
    const std::array<double, 2> start = {10.0, 0.0};
    const auto before = testing_support::allocations();
    const auto run = integrate(ball, start, options, Stepping{}, detector, locator);
    EXPECT_EQ(testing_support::allocations() - before, 0u);
    EXPECT_EQ(run.statistics.events, 13u);
}

TEST(Allocation, NoneWithFixedSteps)
{
    const Options options{.t_end = 20.5, .step = 0.01, .record_events = false};
    expect_none<FixedStep<Rk4>>(options, Ends{}, Newton{});
    expect_none<FixedStep<Rk4>>(options, Extremum{}, Bisection{});
    expect_none<FixedStep<Dopri5>>(options, Extremum{}, Toms748{});
}

TEST(Allocation, NoneUnderErrorControl)
{
    const Options options{.t_end = 20.5, .record_events = false};
    expect_none<ErrorControlled<Dopri5>>(options, Ends{}, Newton{});
    expect_none<ErrorControlled<Dopri5>>(options, Extremum{}, Newton{});
    expect_none<ErrorControlled<CashKarp54>>(options, Ends{}, Newton{});
    expect_none<ErrorControlled<Fehlberg78>>(options, Ends{}, Newton{});
    expect_none<ErrorControlled<Fehlberg78>>(options, Extremum{}, Toms748{});
}

TEST(Allocation, NoneWithANetwork)
{
    const BareNetwork network(load_model(RICOCHET_MODELS "/bouncing-ball-step-0.01.safetensors"));
    const Options options{.t_end = 20.5, .step = 0.01, .record_events = false};
    expect_none<FixedStep<Rk4>>(options, network, Newton{});
}

TEST(Allocation, NoneInTheLoopWithAPlan)
{
    struct Bounded : BouncingBall {
        double speed_bound(double, const std::array<double, 2>& x) const { return std::fabs(x[1]); }
        double acceleration_bound(double, const std::array<double, 2>&) const { return 9.81; }
    };
    const Bounded ball;
    const std::array<double, 2> start = {10.0, 0.0};
    const Options options{.t_end = 20.5, .step = 0.001, .record_events = false};
    // The starts of tentative steps are kept in memory that is allocated once, with the simulation.
    Simulation<Bounded, std::array<double, 2>, FixedStep<Rk4>, Planned<>> simulation(ball, start,
                                                                                     options);
    const auto before = testing_support::allocations();
    const auto run = simulation.take();
    EXPECT_EQ(testing_support::allocations() - before, 0u);
    EXPECT_EQ(run.statistics.events, 13u);
    EXPECT_GT(run.statistics.rollbacks, 0u);
}

/// Heap allocations of a guard, its rate and its bound, at a place not evaluated before.
template <class System>
std::uint64_t allocations_of_guard(const System& system, typename System::State x)
{
    typename System::State dxdt{};
    system.flow(0, x, dxdt);
    x[0] += 1e-3;
    const auto before = testing_support::allocations();
    double sum = system.guard(0, x) + system.guard_rate(0, x, dxdt);
    if constexpr (requires { system.lower_bound(0, x); }) sum += system.lower_bound(0, x);
    EXPECT_FALSE(std::isnan(sum));
    return testing_support::allocations() - before;
}

TEST(Allocation, ExpensiveGuardsNeedNone)
{
    const Cavern cavern({.segments = 100});
    EXPECT_EQ(allocations_of_guard(cavern, cavern.start()), 0u);
    const LeastEigenvalue eigenvalue;
    EXPECT_EQ(allocations_of_guard(eigenvalue, eigenvalue.start()), 0u);
    const PlanarArm<4> arm;
    EXPECT_EQ(allocations_of_guard(arm, arm.start()), 0u);
    const CaveBody body({.cave_refinements = 1, .body_refinements = 1, .grid = 8});
    EXPECT_EQ(allocations_of_guard(body, CaveBody::start()), 0u);
    const Zones zones;
    const auto before = testing_support::allocations();
    EXPECT_FALSE(std::isnan(zones.guard(3, 0.5, zones.start())));
    EXPECT_EQ(testing_support::allocations(), before);
}

}  // namespace
}  // namespace ricochet::allocation_test
