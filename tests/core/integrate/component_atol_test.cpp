// An absolute tolerance for each component. In other units, powers of two, a component's
// tolerance scales with it, and no rounding differs: the run is the same to the last bit.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::component_atol_test {
namespace {

constexpr double ordinary = 1e-10;

/// Coupled springs that strike a wall, component i counted in units of 2^-(7 i).
template <class X>
struct Springs {
    using State = X;
    bool scaled;

    [[nodiscard]] double unit(std::size_t i) const
    {
        return scaled ? std::ldexp(1.0, static_cast<int>(i % 5) * 7) : 1.0;
    }
    void flow(double, const X& x, X& dxdt) const
    {
        const std::size_t n = x.size();
        const auto plain = [&](std::size_t i) { return x[i] / unit(i); };
        for (std::size_t i = 0; i + 1 < n; i += 2) {
            const double next = i + 2 < n ? plain(i + 2) : 0;
            dxdt[i] = plain(i + 1) * unit(i);
            dxdt[i + 1] = (0.5 * next - (1 + static_cast<double>(i)) * plain(i)) * unit(i + 1);
        }
        if (n % 2 == 1) dxdt[n - 1] = -plain(n - 1) * plain(0) * unit(n - 1);
    }
    [[nodiscard]] double guard(double, const X& x) const { return x[0] / unit(0) + 0.5; }
    void reset(double, X& x) const { x[1] = std::fabs(x[1]); }

    [[nodiscard]] X start(std::size_t n) const
    {
        X x{};
        if constexpr (requires { x.resize(n); }) x.resize(n);
        for (std::size_t i = 0; i < n; ++i) {
            x[i] = (1 - 0.125 * static_cast<double>(i)) * unit(i);
        }
        return x;
    }
    [[nodiscard]] std::vector<double> tolerances(std::size_t n) const
    {
        std::vector<double> atol(n);
        for (std::size_t i = 0; i < n; ++i) atol[i] = ordinary * unit(i);
        return atol;
    }
};

template <class X, class Method>
void expect_the_same_in_other_units(std::size_t n)
{
    const Springs<X> plain{false};
    const Springs<X> scaled{true};
    const auto stepping = ErrorControlled<Method>{};
    const Options one{.t_end = 20, .step = 0.1, .rtol = 1e-7, .atol = ordinary};
    Options each = one;
    each.atol = 1e300;  // applies to no component
    each.component_atol = scaled.tolerances(n);
    const auto expected = integrate(plain, plain.start(n), one, stepping);
    const auto found = integrate(scaled, scaled.start(n), each, stepping);
    ASSERT_GT(expected.statistics.events, 2u);
    EXPECT_EQ(found.statistics.steps, expected.statistics.steps);
    EXPECT_EQ(found.statistics.rejected, expected.statistics.rejected);
    EXPECT_EQ(found.statistics.events, expected.statistics.events);
    for (std::size_t i = 0; i < n; ++i) EXPECT_EQ(found.x[i] / scaled.unit(i), expected.x[i]) << i;
}

TEST(ComponentAtol, IsCountedInTheUnitsOfItsComponent)
{
    expect_the_same_in_other_units<std::array<double, 2>, Dopri5>(2);
    expect_the_same_in_other_units<std::array<double, 4>, Fehlberg78>(4);
    expect_the_same_in_other_units<std::array<double, 3>, CashKarp54>(3);
    expect_the_same_in_other_units<std::vector<double>, Dopri5>(4);
    expect_the_same_in_other_units<std::vector<double>, Dopri5>(11);
    expect_the_same_in_other_units<std::vector<double>, Fehlberg78>(7);
}

/// A system without a guard: consecutive steps.
struct Decay {
    using State = std::array<double, 2>;
    void flow(double, const State& x, State& dxdt) const { dxdt = {-x[0], -50 * x[1]}; }
};

TEST(ComponentAtol, SparesStepsOfAComponentThatDoesNotMatter)
{
    const auto steps = [](std::vector<double> atol) {
        const Options options{.t_end = 1, .rtol = 1e-12, .component_atol = std::move(atol)};
        return integrate(Decay{}, {1, 1}, options).statistics.steps;
    };
    EXPECT_LT(2 * steps({1e-12, 1}), steps({1e-12, 1e-12}));
    EXPECT_EQ(
        steps({1e-9, 1e-9}),
        integrate(Decay{}, {1, 1}, {.t_end = 1, .rtol = 1e-12, .atol = 1e-9}).statistics.steps);
}

/// A second component is added at t = 1.
struct Splitting {
    using State = std::vector<double>;
    void flow(double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); ++i) dxdt[i] = std::cos(3 * x[i]);
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return t < 1 ? 1 : std::numeric_limits<double>::infinity();
    }
    void time_reset(double, State& x) const { x.push_back(0.25); }
    static constexpr bool changes_dimension = true;
};

TEST(ComponentAtol, OfComponentsThatAResetAddsIsTheOneForAll)
{
    const auto run = [](double atol, std::vector<double> each) {
        const Options options{
            .t_end = 2, .rtol = 1e-6, .atol = atol, .component_atol = std::move(each)};
        return integrate(Splitting{}, {0.5}, options);
    };
    const auto one = run(1e-9, {});
    const auto each = run(1e-9, {1e-9});
    ASSERT_EQ(one.x.size(), 2u);
    EXPECT_EQ(each.x, one.x);
    EXPECT_EQ(each.statistics.steps, one.statistics.steps);
    EXPECT_NE(run(1e-5, {1e-9}).x, one.x);
}

template <class Function>
std::string refusal(const Function& function)
{
    try {
        function();
    } catch (const std::invalid_argument& reason) {
        return reason.what();
    }
    return "accepted";
}

TEST(ComponentAtol, IsOneForEachComponent)
{
    const auto with = [](double rtol, std::vector<double> each) {
        return refusal([&] {
            (void)integrate(Decay{}, {1, 1},
                            {.t_end = 1, .rtol = rtol, .component_atol = std::move(each)});
        });
    };
    EXPECT_EQ(with(1e-8, {1e-9, 0}), "accepted");
    EXPECT_EQ(with(1e-8, {1e-9}),
              "integrate: component_atol must have one number for each of the 2 components of the "
              "start, got 1");
    EXPECT_EQ(with(1e-8, {1e-9, -1}),
              "integrate: every component_atol must be zero or positive, and finite, got -1");
    EXPECT_EQ(with(0, {1e-9, 0}),
              "integrate: rtol must be positive where an absolute one is zero, got 0");
    EXPECT_EQ(with(0, {1e-9, 1e-7}), "accepted");
}

TEST(ComponentAtol, BelongsToTheRunThatASnapshotIsOf)
{
    const Decay system;
    const auto simulation = [&](std::vector<double> each) {
        return Simulation(system, Decay::State{1, 1},
                          Options{.t_end = 1, .component_atol = std::move(each)});
    };
    auto first = simulation({1e-9, 1e-6});
    first.advance();
    const Snapshot saved = first.save();
    auto same = simulation({1e-9, 1e-6});
    same.restore(saved);
    EXPECT_EQ(same.take().x, first.take().x);
    auto other = simulation({1e-9, 1e-7});
    EXPECT_NE(refusal([&] { other.restore(saved); }).find("component_atol"), std::string::npos);
}

}  // namespace
}  // namespace ricochet::component_atol_test
