// Sensitivities by Taylor series.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::series_sensitivity_test {
namespace {

using X = std::array<double, 2>;
using ByTaylor = ErrorControlled<Taylor>;
using ByFehlberg = ErrorControlled<Fehlberg78>;

/// Steps of both have errors within 1e-13, so the derivatives agree to that
/// times their growth; differences by parameters have errors of some 1e-12 of them.
template <class State>
void expect_near(const Sensitivities<State>& a, const Sensitivities<State>& b, double relative)
{
    ASSERT_EQ(a.run.outcome, b.run.outcome);
    ASSERT_EQ(a.run.events.size(), b.run.events.size());
    ASSERT_EQ(a.undefined_at.has_value(), b.undefined_at.has_value());
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

TEST(SeriesSensitivity, AgreesWithRungeKuttaThroughImpactsInFewerSteps)
{
    const ImpactOscillator system({.frequency = 0.8});
    Directions<ImpactOscillator> directions;
    directions.parameters.push_back(
        {.with = [](double f) { return ImpactOscillator({.frequency = f}); }, .nominal = 0.8});
    directions.parameters.push_back(
        {.with = [](double r) { return ImpactOscillator({.frequency = 0.8, .restitution = r}); },
         .nominal = 0.8});
    const Options options{.t_end = 40, .rtol = 1e-13, .atol = 1e-13};
    const auto series = sensitivities(system, X{0, 0}, directions, options, ByTaylor{});
    const auto stages = sensitivities(system, X{0, 0}, directions, options, ByFehlberg{});
    ASSERT_GE(series.run.events.size(), 5U);
    expect_near(series, stages, 1e-9);
    EXPECT_LT(5 * series.run.statistics.steps, stages.run.statistics.steps);
}

TEST(SeriesSensitivity, OfABallIsThatOfTheGeometricSeriesToRounding)
{
    // Impact n is at t0 (1 + 2 (r + ... + r^n)), t0 = sqrt(2 h / g): by the height t_n / (2 h), by
    // r t0 2 (1 + 2 r + ... + n r^(n-1)).
    const double h = 10, g = 9.81, r = 0.9, t0 = std::sqrt(2 * h / g);
    Directions<BouncingBall> directions;
    directions.parameters.push_back(
        {.with = [](double e) { return BouncingBall({.restitution = e}); }, .nominal = r});
    const auto found = sensitivities(BouncingBall(), X{h, 0}, directions,
                                     {.t_end = 15, .rtol = 1e-13, .atol = 1e-13}, ByTaylor{});
    ASSERT_GE(found.events.size(), 8U);
    double sum = 0, slope = 0, power = 1;
    for (std::size_t n = 0; n < found.events.size(); ++n) {
        const double t = t0 * (1 + 2 * sum);
        EXPECT_NEAR(found.run.events[n].t, t, 1e-13);
        EXPECT_NEAR(found.events[n].dt[0], t / (2 * h), 1e-13);
        EXPECT_NEAR(found.events[n].dt[2], 2 * t0 * slope, 1e-10);  // by differences
        slope += static_cast<double>(n + 1) * power;
        sum += power *= r;
    }
}

/// A ball for parameters of any scalar.
template <class P>
struct BallOf {
    using State = X;
    P gravity = 9.81;  ///< [m/s^2]
    P restitution = 0.9;
    template <class S>
    void flow(const S&, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity;
    }
    template <class S>
    [[nodiscard]] S guard(const S&, const std::array<S, 2>& x) const
    {
        return x[0];
    }
    template <class S>
    void reset(const S&, std::array<S, 2>& x) const
    {
        x[0] = 0.0;
        x[1] = -restitution * x[1];
    }
};

TEST(SeriesSensitivity, ByParametersOfAnyScalarIsThatOfTheGeometricSeriesToRounding)
{
    // As above; by the gravity -t_n / (2 g).
    const double h = 10, g = 9.81, r = 0.9, t0 = std::sqrt(2 * h / g);
    Directions<BallOf<double>> directions;
    directions.initial_state = false;
    directions.parameters = {
        parameter<BallOf<double>>([](auto p) { return BallOf<decltype(p)>{.gravity = p}; }, g),
        parameter<BallOf<double>>([](auto p) { return BallOf<decltype(p)>{.restitution = p}; }, r)};
    const auto found = sensitivities(BallOf<double>{}, X{h, 0}, directions,
                                     {.t_end = 15, .rtol = 1e-13, .atol = 1e-13}, ByTaylor{});
    ASSERT_GE(found.events.size(), 8U);
    double sum = 0, slope = 0, power = 1;
    for (std::size_t n = 0; n < found.events.size(); ++n) {
        const double t = t0 * (1 + 2 * sum);
        // Each of ten impacts rounds numbers below 2 t0 slope < 200 by a few units, 3e-14.
        EXPECT_NEAR(found.events[n].dt[0], -t / (2 * g), 1e-12);
        EXPECT_NEAR(found.events[n].dt[1], 2 * t0 * slope, 1e-12);
        slope += static_cast<double>(n + 1) * power;
        sum += power *= r;
    }
}

TEST(SeriesSensitivity, FollowsModes)
{
    const Options options{.t_end = 20, .rtol = 1e-13, .atol = 1e-13};
    expect_near(sensitivities(Thermostat(), {20.0}, {}, options, ByTaylor{}),
                sensitivities(Thermostat(), {20.0}, {}, options, ByFehlberg{}), 1e-11);
}

/// A guard that is touched: derivatives end there, and the motion continues.
struct Touching {
    using State = X;
    template <class S>
    void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    [[nodiscard]] GuardInfo guard_info() const { return {.name = "crest", .touch = 1e-9}; }
    template <class S>
    [[nodiscard]] S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return 1.0 - x[0];
    }
    void reset(double /*t*/, X& x) const { x[1] *= -0.5; }
};

TEST(SeriesSensitivity, WhereItEndsItSaysSo)
{
    const auto found = sensitivities(Touching{}, X{0, 1}, {},
                                     {.t_end = 5, .rtol = 1e-13, .atol = 1e-13}, ByTaylor{});
    ASSERT_EQ(found.run.events.size(), 1U);
    ASSERT_TRUE(found.undefined_at.has_value());
    EXPECT_EQ(found.undefined_at->reason, Undefined::grazing);
    EXPECT_TRUE(std::isnan(found.state(0, 0)));
    EXPECT_NEAR(found.run.x[0], std::sin(5.0), 1e-12);
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

TEST(SeriesSensitivity, OfStatesThatAreSizedAtRunTime)
{
    const Options options{.t_end = 1, .rtol = 1e-13, .atol = 1e-13};
    const std::vector<double> x0{1, 0.5, 0.7};
    expect_near(sensitivities(OnVectors{}, x0, {}, options, ByTaylor{}),
                sensitivities(OnVectors{}, x0, {}, options, ByFehlberg{}), 1e-12);
}

}  // namespace
}  // namespace ricochet::series_sensitivity_test
