// Nothing is allocated between the start and the end of a run.

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>

#include "ricochet/detect/ends.hpp"
#include "ricochet/detect/network.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/locate/bisection.hpp"
#include "ricochet/locate/toms748.hpp"
#include "ricochet/nn/safetensors.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace {
std::atomic<long> allocations = 0;

void* count_and_allocate(std::size_t size)
{
    ++allocations;
    if (void* memory = std::malloc(size ? size : 1)) return memory;
    throw std::bad_alloc();
}
}  // namespace

void* operator new(std::size_t size)
{
    return count_and_allocate(size);
}
void* operator new[](std::size_t size)
{
    return count_and_allocate(size);
}
void operator delete(void* memory) noexcept
{
    std::free(memory);
}
void operator delete[](void* memory) noexcept
{
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept
{
    std::free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept
{
    std::free(memory);
}

namespace ricochet {
namespace {

TEST(Allocation, TheCounterCounts)
{
    const long before = allocations;
    delete new int(1);
    EXPECT_EQ(allocations - before, 1);
}

template <class Stepping, class Detector, class Locator>
void expect_none(const Options& options, const Detector& detector, const Locator& locator)
{
    const BouncingBall ball;
    const std::array<double, 2> start = {10.0, 0.0};
    const long before = allocations;
    const auto run = integrate(ball, start, options, Stepping{}, detector, locator);
    EXPECT_EQ(allocations - before, 0);
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
    expect_none<ErrorControlled<Dopri5>>(options, Extremum{}, Newton{});
    expect_none<ErrorControlled<CashKarp54>>(options, Ends{}, Newton{});
    expect_none<ErrorControlled<Fehlberg78>>(options, Extremum{}, Toms748{});
}

TEST(Allocation, NoneWithANetwork)
{
    const Network network(load_model(RICOCHET_MODELS "/bouncing-ball-step-0.01.safetensors"));
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
    // The starts of tentative steps are kept in room that is made once, with the simulation.
    Simulation<Bounded, std::array<double, 2>, FixedStep<Rk4>, Planned<>> simulation(ball, start,
                                                                                     options);
    const long before = allocations;
    const auto run = simulation.take();
    EXPECT_EQ(allocations - before, 0);
    EXPECT_EQ(run.statistics.events, 13u);
    EXPECT_GT(run.statistics.rollbacks, 0u);
}

}  // namespace
}  // namespace ricochet
