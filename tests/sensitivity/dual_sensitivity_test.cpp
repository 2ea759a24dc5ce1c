// Sensitivities of systems that take any scalar, beside those of systems that give their
// derivatives, and of systems that have neither.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>

#include "ricochet/guard.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "sensitivity_systems.hpp"

namespace ricochet::dual_sensitivity_test {

namespace {

using X = std::array<double, 2>;

/// x'' = -sin x - x'/10 + cos(2 t), with a moving wall and a nonlinear reset; with derivatives by
/// duals, and by hand.
struct ByText {
    using State = X;
    template <class S>
    void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cos, std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -sin(x[0]) - 0.1 * x[1] + cos(2.0 * t);
    }
    template <class S>
    [[nodiscard]] S guard(const S& t, const std::array<S, 2>& x) const
    {
        using std::sin;
        return 0.8 + 0.1 * sin(3.0 * t) - x[0] * x[0];
    }
    template <class S>
    void reset(const S& t, std::array<S, 2>& x) const
    {
        using std::exp;
        x[0] *= 0.9;
        x[1] = -0.8 * x[1] + 0.1 * exp(-t) * x[0];
    }
};

struct ByHand {
    using State = X;
    ByText text;
    void flow(double t, const X& x, X& dxdt) const { text.flow(t, x, dxdt); }
    [[nodiscard]] double guard(double t, const X& x) const { return text.guard(t, x); }
    [[nodiscard]] double guard_rate(double t, const X& x, const X& dxdt) const
    {
        return 0.1 * (std::cos(3 * t) * 3) - 2 * x[0] * dxdt[0];
    }
    void reset(double t, X& x) const { text.reset(t, x); }
    void flow_derivative(double, const X& x, const X& s, X& ds) const
    {
        ds = {s[1], -std::cos(x[0]) * s[0] - 0.1 * s[1]};
    }
    [[nodiscard]] double guard_derivative(double, const X& x, const X& s) const
    {
        return -2 * x[0] * s[0];
    }
    void reset_derivative(double t, const X& x, double dt, X& s) const
    {
        const double e = std::exp(-t);
        s = {0.9 * s[0], -0.8 * s[1] + 0.1 * e * 0.9 * s[0] - 0.1 * e * 0.9 * x[0] * dt};
    }
};

/// The same without any derivative.
struct ByDifferences {
    using State = X;
    ByText text;
    void flow(double t, const X& x, X& dxdt) const { text.flow(t, x, dxdt); }
    [[nodiscard]] double guard(double t, const X& x) const { return text.guard(t, x); }
    void reset(double t, X& x) const { text.reset(t, x); }
};

template <class A, class B>
void expect_near(const Sensitivities<A>& a, const Sensitivities<B>& b, double relative)
{
    ASSERT_EQ(a.run.events.size(), b.run.events.size());
    EXPECT_FALSE(a.undefined_at || b.undefined_at);
    const auto near = [&](const auto& one, const auto& other) {
        EXPECT_LE((one - other).cwiseAbs().maxCoeff(),
                  relative * (1 + other.cwiseAbs().maxCoeff()));
    };
    for (std::size_t k = 0; k < a.events.size(); ++k) {
        near(a.events[k].dt, b.events[k].dt);
        near(a.events[k].before, b.events[k].before);
        near(a.events[k].after, b.events[k].after);
    }
    near(a.state, b.state);
}

// Both follow one motion in the same steps; they differ by the rounding of each derivative, a few
// units in the last place at each of 300 steps.
TEST(DualSensitivity, IsThatOfDerivativesByHand)
{
    const Options options{.t_end = 20, .rtol = 1e-10, .atol = 1e-12};
    const auto text = sensitivities(ByText{}, {0.5, 1.0}, {}, options);
    ASSERT_GE(text.events.size(), 3u);
    expect_near(text, sensitivities(ByHand{}, {0.5, 1.0}, {}, options), 1e-13);
    // Differences have errors of some 1e-13 of each derivative, but may change a step.
    expect_near(text, sensitivities(ByDifferences{}, {0.5, 1.0}, {}, options), 1e-8);
}

TEST(DualSensitivity, OfABallIsThatOfTheExactOne)
{
    const Options options{.t_end = 6, .rtol = 1e-10, .atol = 1e-12};
    expect_near(sensitivities(BouncingBall(), {10.0, 0.0}, {}, options),
                sensitivities(test::ExactBall{}, {10.0, 0.0}, {}, options), 1e-13);
}

/// A system that only has its functions of doubles.
template <class System>
struct OfDoubles {
    using State = typename System::State;
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;
    System system;
    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        system.flow(mode, t, x, dxdt);
    }
    [[nodiscard]] double guard(std::size_t which, double t, const State& x) const
    {
        return system.guard(which, t, x);
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return system.enabled(which, mode);
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, State& x) const
    {
        return system.reset(which, mode, t, x);
    }
};

// Differences by the five-point formula are exact on a linear flow except for the rounding of
// numbers of size 20 over a step of 0.02, 2e-13, which adds up over some ten derivatives.
TEST(DualSensitivity, OfAThermostatIsThatOfDifferences)
{
    const Options options{.t_end = 20, .rtol = 1e-10, .atol = 1e-12};
    expect_near(sensitivities(Thermostat(), {20.0}, {}, options),
                sensitivities(OfDoubles<Thermostat>{}, {20.0}, {}, options), 1e-11);
}

/// Sized at run time.
struct OnVectors {
    using State = std::vector<double>;
    template <class V>
    void flow(const ScalarOf<V>&, const V& x, V& dxdt) const
    {
        using std::sin;
        for (std::size_t i = 0; i < x.size(); ++i) dxdt[i] = -sin(x[i]) * x[(i + 1) % x.size()];
    }
};

TEST(DualSensitivity, OfStatesThatAreSizedAtRunTime)
{
    const Options options{.t_end = 1, .rtol = 1e-11, .atol = 1e-13};
    const std::vector<double> x0{1, 0.5, 0.7};
    const auto s = sensitivities(OnVectors{}, x0, {}, options);
    const double h = 1e-4;
    for (std::size_t j = 0; j < 3; ++j) {
        auto up = x0, down = x0;
        up[j] += h;
        down[j] -= h;
        const auto above = integrate(OnVectors{}, up, options);
        const auto below = integrate(OnVectors{}, down, options);
        for (std::size_t i = 0; i < 3; ++i) {
            // h^2 / 6 times third derivatives of about one.
            EXPECT_NEAR(s.state(static_cast<long>(i), static_cast<long>(j)),
                        (above.x[i] - below.x[i]) / (2 * h), 1e-8);
        }
    }
}

/// A pendulum beside a wall, for parameters of any scalar.
template <class P>
struct Swing {
    using State = X;
    P pull = 1;     ///< [1/s^2]
    P wall = -0.5;  ///< [rad]
    P restitution = 0.9;
    template <class S>
    void flow(const S&, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -pull * sin(x[0]);
    }
    template <class S>
    [[nodiscard]] S guard(const S&, const std::array<S, 2>& x) const
    {
        return x[0] - wall;
    }
    template <class S>
    void reset(const S&, std::array<S, 2>& x) const
    {
        x[0] = wall;
        x[1] = -restitution * x[1];
    }
};

[[nodiscard]] Directions<Swing<double>> exact_parameters()
{
    Directions<Swing<double>> directions;
    directions.parameters = {
        parameter<Swing<double>>([](auto p) { return Swing<decltype(p)>{.pull = p}; }, 1),
        parameter<Swing<double>>([](auto p) { return Swing<decltype(p)>{.wall = p}; }, -0.5),
        parameter<Swing<double>>([](auto p) { return Swing<decltype(p)>{.restitution = p}; }, 0.9)};
    return directions;
}

TEST(DualSensitivity, ByAParameterOfAnyScalarIsThatOfDifferences)
{
    const Options options{.t_end = 20, .rtol = 1e-10, .atol = 1e-12};
    const auto exact = sensitivities(Swing<double>{}, {1.0, 0.0}, exact_parameters(), options);
    ASSERT_GE(exact.events.size(), 4U);
    auto differences = exact_parameters();
    for (auto& parameter : differences.parameters) parameter.exact = {};
    // As above: differences may change a step.
    expect_near(exact, sensitivities(Swing<double>{}, {1.0, 0.0}, differences, options), 1e-8);
}

TEST(DualSensitivity, ByAParameterOfAnyScalarTakesNoDifferences)
{
    const Options options{.t_end = 20, .rtol = 1e-10, .atol = 1e-12};
    auto deaf = exact_parameters();
    for (auto& parameter : deaf.parameters) {
        parameter.with = [](double) { return Swing<double>{}; };
    }
    const auto one = sensitivities(Swing<double>{}, {1.0, 0.0}, exact_parameters(), options);
    const auto other = sensitivities(Swing<double>{}, {1.0, 0.0}, deaf, options);
    EXPECT_EQ(one.state, other.state);
    ASSERT_EQ(one.events.size(), other.events.size());
    for (std::size_t k = 0; k < one.events.size(); ++k) {
        EXPECT_EQ(one.events[k].dt, other.events[k].dt);
        EXPECT_EQ(one.events[k].after, other.events[k].after);
    }
}

}  // namespace

}  // namespace ricochet::dual_sensitivity_test
