// The order of every method, kept through events.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "walled_oscillator.hpp"

namespace ricochet::convergence_test {
namespace {

using test::WalledOscillator;

/// Largest error of the impact times to t = 20, with steps of length h.
template <class Method>
double largest_error(double h)
{
    const WalledOscillator oscillator;
    const auto exact = oscillator.impacts(20);
    const auto run =
        integrate(oscillator, {1.0, 0.0}, {.t_end = 20, .step = h}, FixedStep<Method>{}, Ends{});
    EXPECT_EQ(run.events.size(), exact.size());
    double worst = 0;
    for (std::size_t i = 0; i < std::min(exact.size(), run.events.size()); ++i) {
        worst = std::max(worst, std::abs(run.events[i].t - exact[i]));
    }
    return worst;
}

/// Observed order between steps h and h / 4. Both are small enough for the leading
/// term to dominate and large enough for the error to stay above rounding, 1e-13;
/// the next term changes the observed order by a few tenths.
template <class Method>
double observed_order(double h)
{
    return std::log2(largest_error<Method>(h) / largest_error<Method>(h / 4)) / 2;
}

/// Residuals of the order conditions up to order 3 of weights w: sum w - 1, w.c - 1/2, w.c^2 - 1/3,
/// w.A c - 1/6; those of error weights are of zero on the right (J. C. Butcher, Numerical Methods
/// for Ordinary Differential Equations, 2016, section 31).
template <class Tableau, std::size_t count>
constexpr std::array<double, 4> conditions(const std::array<double, count>& w, double right)
{
    std::array<double, 4> sums{-right, -right / 2, -right / 3, -right / 6};
    for (std::size_t i = 0; i < count; ++i) {
        const bool at_end = i == Tableau::stages;  // first same as last
        const double c = at_end ? 1 : Tableau::c[i];
        double inner = 0;
        for (std::size_t j = 0; j < Tableau::stages; ++j) {
            inner += (at_end ? Tableau::b[j] : Tableau::a[i][j]) * Tableau::c[j];
        }
        sums[0] += w[i];
        sums[1] += w[i] * c;
        sums[2] += w[i] * c * c;
        sums[3] += w[i] * inner;
    }
    return sums;
}

/// Whether the weights, and the error weights up to the order of the estimate, satisfy the
/// conditions up to order 3, to the rounding of a sum of a dozen terms of up to a dozen.
template <class Tableau>
constexpr bool satisfies_conditions()
{
    constexpr double rounding = 1e-14;
    constexpr std::array<int, 4> order{1, 2, 3, 3};
    const auto hold = [&](const std::array<double, 4>& sums, int up_to) {
        for (std::size_t k = 0; k < sums.size(); ++k) {
            const bool zero = sums[k] < rounding && sums[k] > -rounding;
            if (order[k] <= up_to && !zero) return false;
        }
        return true;
    };
    bool fine = hold(conditions<Tableau>(Tableau::b, 1), Tableau::order);
    if constexpr (requires { Tableau::error; }) {
        fine = fine && hold(conditions<Tableau>(Tableau::error, 0), Tableau::error_order);
    }
    return fine;
}
static_assert(satisfies_conditions<detail::CashKarp54Tableau>());
static_assert(satisfies_conditions<detail::Dopri5Tableau>());
static_assert(satisfies_conditions<detail::Fehlberg78Tableau>());

TEST(Convergence, EulerKeepsOrderOneThroughEvents)
{
    EXPECT_NEAR(observed_order<Euler>(1e-3), 1, 0.1);
}

TEST(Convergence, Rk4KeepsOrderFourThroughEvents)
{
    EXPECT_NEAR(observed_order<Rk4>(0.05), 4, 0.25);
}

TEST(Convergence, CashKarpKeepsOrderFiveThroughEvents)
{
    EXPECT_NEAR(observed_order<CashKarp54>(0.1), 5, 0.25);
}

TEST(Convergence, Dopri5KeepsOrderFiveThroughEvents)
{
    EXPECT_NEAR(observed_order<Dopri5>(0.1), 5, 0.25);
}

TEST(Convergence, Fehlberg78KeepsOrderSevenAtLeastThroughEvents)
{
    // Odeint advances with the eighth-order weights.
    EXPECT_GE(observed_order<Fehlberg78>(0.8), 7.75);
}

/// Error against tolerance: two decades of tolerance must give at least one of error.
template <class Method>
void expect_proportional()
{
    const WalledOscillator oscillator;
    const auto exact = oscillator.impacts(20);
    double previous = 1;
    for (const double rtol : {1e-5, 1e-7, 1e-9, 1e-11}) {
        const auto run =
            integrate(oscillator, {1.0, 0.0}, {.t_end = 20, .rtol = rtol, .atol = rtol},
                      ErrorControlled<Method>{});
        ASSERT_EQ(run.events.size(), exact.size());
        double worst = 0;
        for (std::size_t i = 0; i < exact.size(); ++i) {
            worst = std::max(worst, std::abs(run.events[i].t - exact[i]));
        }
        EXPECT_LT(worst, previous / 10) << "rtol " << rtol;
        EXPECT_LT(worst, 100 * rtol);
        previous = worst;
    }
}

TEST(Convergence, ErrorFollowsToleranceWithDopri5)
{
    expect_proportional<Dopri5>();
}
TEST(Convergence, ErrorFollowsToleranceWithCashKarp)
{
    expect_proportional<CashKarp54>();
}
TEST(Convergence, ErrorFollowsToleranceWithFehlberg78)
{
    expect_proportional<Fehlberg78>();
}

TEST(NamedMethods, AreThoseOfMethodNameInItsOrder)
{
    EXPECT_EQ(detail::NameOf<Euler>::name, MethodName::euler);
    EXPECT_EQ(detail::NameOf<Rk4>::name, MethodName::rk4);
    EXPECT_EQ(detail::NameOf<CashKarp54>::name, MethodName::cash_karp54);
    EXPECT_EQ(detail::NameOf<Dopri5>::name, MethodName::dopri5);
    EXPECT_EQ(detail::NameOf<Fehlberg78>::name, MethodName::fehlberg78);
    EXPECT_FALSE(detail::NameOf<ThisStepper<int>>::known);
    for (const auto& method : detail::named_methods) {
        EXPECT_EQ(method_named(name(method.name)), method.name) << method.spelled;
    }
    EXPECT_EQ(method_named("dopri"), std::nullopt);
    EXPECT_FALSE(estimates_error(MethodName::rk4));
    EXPECT_TRUE(estimates_error(MethodName::dopri5));
}

TEST(NamedMethods, AreListedByMessages)
{
    EXPECT_EQ(detail::spelled_methods(true), "cash-karp54, dopri5 or fehlberg78");
    EXPECT_EQ(detail::spelled_methods(false, "'"),
              "'euler', 'rk4', 'cash-karp54', 'dopri5' or 'fehlberg78'");
}

/// The kernel of every name is that of its method: the same bits as the method as a type.
template <class Method>
void expect_own_kernel()
{
    const WalledOscillator oscillator;
    const Options options{.t_end = 3, .step = 0.01};
    const auto typed = integrate(oscillator, {1.0, 0.0}, options, FixedStep<Method>{});
    const auto named = integrate(oscillator, {1.0, 0.0}, options,
                                 FixedStep<MethodByName>{{detail::NameOf<Method>::name}});
    EXPECT_EQ(typed.x, named.x) << Method::name;
    EXPECT_EQ(typed.statistics.flow_calls, named.statistics.flow_calls) << Method::name;
}

TEST(NamedMethods, HaveTheirOwnKernels)
{
    expect_own_kernel<Euler>();
    expect_own_kernel<Rk4>();
    expect_own_kernel<CashKarp54>();
    expect_own_kernel<Dopri5>();
    expect_own_kernel<Fehlberg78>();
}

}  // namespace
}  // namespace ricochet::convergence_test
