// Nothing is allocated between the start and the end of a set-valued run.

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/incline_block.hpp"

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

template <class System>
void expect_no_allocation(const System& system, const StateOf<System>& w0,
                          const SetValuedOptions& options)
{
    SetValuedMotion<System> motion(system, w0, options);
    const long before = allocations;
    const SetValuedOutcome outcome = motion.run();
    EXPECT_EQ(allocations - before, 0);
    EXPECT_EQ(outcome, SetValuedOutcome::reached_end);
    EXPECT_GT(motion.statistics().accepted, 20U);
}

TEST(NonsmoothAllocation, TheCounterCounts)
{
    const long before = allocations;
    delete new int(1);
    EXPECT_GE(allocations - before, 0);
    void* volatile kept = ::operator new(8);
    ::operator delete(kept);
    EXPECT_GT(allocations - before, 0);
}

TEST(NonsmoothAllocation, StepsOfFixedSizeAllocateNothing)
{
    const auto w0 = DiodeCircuit::start();
    expect_no_allocation(DiodeCircuit(), w0, {.t_end = 2, .step = 0.01});
    expect_no_allocation(DiodeCircuit(), w0,
                         {.t_end = 2, .step = 0.01, .switches = Switches::located});
    expect_no_allocation(DiodeCircuit(), w0,
                         {.t_end = 2,
                          .step = 1e-3,
                          .controller = FilteredStep::h211b(4),
                          .estimate = ErrorEstimate::doubling});
    expect_no_allocation(
        DiodeCircuit(), w0,
        {.t_end = 2, .step = 0.01, .scheme = {.stage = {.method = StageMethod::newton}}});
    expect_no_allocation(
        DiodeCircuit(), w0,
        {.t_end = 2,
         .step = 0.01,
         .scheme = {.stage = {.method = StageMethod::fixed_point, .tolerance = 1e-10}}});
    expect_no_allocation(InclineBlock(), {1, 1, 0, 0}, {.t_end = 1, .step = 0.01});
}

}  // namespace
}  // namespace ricochet
