// Compiled with assertions, as without NDEBUG: those of Eigen see a state of a wrong size.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <type_traits>

#include "ricochet/filippov.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::asserts_test {
namespace {

/// A ball and components that follow its height, on a floor, with a clock that pushes it.
template <int n>
struct Ball {
    using State = Eigen::Matrix<double, n, 1>;
    using Mode = ricochet::Mode;
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 2;

    void flow(Mode mode, double, const State& x, State& dxdt) const
    {
        dxdt.setConstant(-x[0]);
        dxdt[0] = n > 1 ? x[n > 1 ? 1 : 0] : -1;
        if (n > 1) dxdt[n > 1 ? 1 : 0] = mode == 0 ? -9.81 : -1.6;
    }
    [[nodiscard]] double guard(std::size_t which, Mode, double, const State& x) const
    {
        EXPECT_EQ(x.size(), n);
        return which == 0 ? x[0] : x[0] - 0.5;
    }
    Mode reset(std::size_t which, Mode mode, double, State& x) const
    {
        if (which == 1) return 1 - mode;
        x[0] = 0.7;
        if (n > 1) x[n > 1 ? 1 : 0] = 0;
        return mode;
    }
    [[nodiscard]] double next_time_event(double t) const { return t < 0.3 ? 0.3 : 1e9; }
    Mode time_reset(Mode mode, double, State& x) const
    {
        x[0] += 0.1;
        return mode;
    }
};

template <class Size>
class Asserts : public testing::Test {
};
template <int n>
using Size = std::integral_constant<int, n>;
using Sizes = testing::Types<Size<1>, Size<2>, Size<3>, Size<4>, Size<5>>;
TYPED_TEST_SUITE(Asserts, Sizes);

TYPED_TEST(Asserts, FixedEigenStatesKeepTheirSize)
{
    using System = Ball<TypeParam::value>;
    typename System::State x0 = System::State::Zero();
    x0[0] = 1;
    const Options options{.t_end = 2, .record_steps = true, .sample_times = {0.5, 1.5}};
    const auto run = integrate(System{}, x0, options);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.events.size(), 4u);
    Simulation simulation(System{}, x0, options);
    while (simulation.step()) {
    }
    EXPECT_EQ(simulation.x(), run.x);
}

}  // namespace
}  // namespace ricochet::asserts_test
