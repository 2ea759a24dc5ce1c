// Nothing is allocated between the start and the end of a set-valued run.

#include <gtest/gtest.h>

#include <cmath>

#include "allocations.hpp"
#include "problems/incline_block.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/systems/diode_circuit.hpp"

namespace ricochet::allocation_test {
namespace {

template <class System>
void expect_no_allocation(const System& system, const StateOf<System>& w0,
                          const SetValuedOptions& options)
{
    SetValuedMotion<System> motion(system, w0, options);
    const auto before = testing_support::allocations();
    const Outcome outcome = motion.run();
    EXPECT_EQ(testing_support::allocations() - before, 0u);
    EXPECT_EQ(outcome, Outcome::reached_end);
    EXPECT_GT(motion.statistics().accepted, 20U);
}

/// A size that the library has not compiled: two masses between springs, with friction, and a
/// filter.
struct TwoMasses {
    static constexpr int state_size = 5;
    static constexpr int reaction_size = 2;
    using Vector = Eigen::Matrix<double, 5, 1>;
    void smooth(double t, const Vector& w, Vector& f) const
    {
        f << std::sin(t) - w[2], w[2] - 2 * w[3], w[0] - w[1], w[1], w[2] - w[4];
    }
    [[nodiscard]] sets::Box<2> reaction_set(double, const Vector&) const
    {
        return {{-0.3, -0.2}, {0.3, 0.2}};
    }
};

TEST(NonsmoothAllocation, TheCounterCounts)
{
    // Called by name, it is not elided.
    const auto before = testing_support::allocations();
    ::operator delete(::operator new(8));
    EXPECT_EQ(testing_support::allocations() - before, 1u);
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
    for (const StageMethod method : {StageMethod::automatic, StageMethod::newton}) {
        expect_no_allocation(TwoMasses(), {1, 0, 0, 0, 0},
                             {.t_end = 1, .step = 0.01, .scheme = {.stage = {.method = method}}});
    }
    expect_no_allocation(TwoMasses(), {1, 0, 0, 0, 0},
                         {.t_end = 1, .step = 0.01, .switches = Switches::located});
}

}  // namespace
}  // namespace ricochet::allocation_test
