// The kernels of large states where the compiler inlines nothing that it is not made to: this file
// is compiled without optimisation, for tableaus of its own, since others are in the library.
#include "core/large_kernel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "ricochet/detail/kernels.hpp"

namespace ricochet::large_kernel_test {
namespace {

using State = std::vector<double>;

struct OwnDopri5 : detail::Dopri5Tableau {};
struct OwnFehlberg78 : detail::Fehlberg78Tableau {};

/// Oscillators one after the other, and a clock, whose rate depends on nothing: where its estimate
/// is zero, `Fehlberg78` takes another.
bool flow(void* /*adapter*/, Mode /*mode*/, double /*t*/, const State& x, State& dxdt)
{
    for (std::size_t i = 0; i + 1 < x.size(); ++i) dxdt[i] = std::sin(x[i + 1]) - 0.1 * x[i];
    dxdt.back() = 1;
    return true;
}

detail::StepState<State> start(std::size_t size)
{
    State x(size);
    for (std::size_t i = 0; i < size; ++i) x[i] = std::cos(static_cast<double>(i));
    detail::StepState<State> step(x);
    step.flow = &flow;
    flow(nullptr, 0, 0, step.x0, step.rate0);
    return step;
}

/// Both programs round each sum and product by itself, so that no bit differs.
template <class Tableau>
void expect_bits_of(MethodName method, std::size_t size)
{
    const auto own = detail::LargeKernel<Tableau>::make();
    const auto& known = detail::kernel_by_name<State>(method, size);
    auto step = start(size), expected = start(size);

    const double ratio = own.attempt(nullptr, step, 0.1, 1e-9, 1e-12);

    EXPECT_EQ(ratio, known.attempt(nullptr, expected, 0.1, 1e-9, 1e-12));
    EXPECT_GT(ratio, 0);
    EXPECT_EQ(step.x1, expected.x1);
    EXPECT_EQ(step.rate1, expected.rate1);
    EXPECT_EQ(step.large.remainder1, expected.large.remainder1);
    EXPECT_NE(step.x1, step.x0);
}

// Vectors of four doubles are returned in a register by code for AVX2, and in memory by code for
// any processor: between the two they may not pass through a function.
TEST(LargeKernel, HasTheBitsOfOptimisedCodeWhereNothingIsInlined)
{
    for (std::size_t size = 2; size <= 9; ++size) {  // with and without four components together
        expect_bits_of<OwnDopri5>(MethodName::dopri5, size);
        expect_bits_of<OwnFehlberg78>(MethodName::fehlberg78, size);
    }
}

}  // namespace
}  // namespace ricochet::large_kernel_test
