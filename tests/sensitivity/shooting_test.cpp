#include "ricochet/sensitivity/sensitivities.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <stdexcept>
#include <string>

#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"

namespace ricochet::shooting_test {
namespace {

using std::numbers::pi;
using X1 = std::array<double, 1>;
using X2 = std::array<double, 2>;

const Options fine{.rtol = 1e-12, .atol = 1e-13};

// --- forced ---

/// x'' + 0.2 x' + x = cos(2 t).
struct ForcedLinear {
    using State = X2;
    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = std::cos(2 * t) - x[0] - 0.2 * x[1];
    }
};

// x = Re(exp(2it) / (1 - 4 + 0.4 i)), and the multipliers are exp(lambda T) with lambda
// = -0.1 +- i sqrt(0.99). The map is affine, so one correction is enough.
TEST(Shooting, TheOrbitOfALinearOscillatorTakesOneCorrection)
{
    const auto orbit =
        find_periodic_orbit(ForcedLinear{}, {3.0, -2.0}, {.period = pi, .tolerance = 1e-11}, fine);
    ASSERT_TRUE(orbit.converged);
    EXPECT_EQ(orbit.end, ShootingEnd::closed);
    EXPECT_EQ(orbit.iterations, 1);
    const std::complex<double> amplitude = 1.0 / std::complex<double>(-3, 0.4);
    // The contraction of the map is slow, 1 - exp(-0.1 pi): it leaves 4 times the error
    // of a run.
    EXPECT_NEAR(orbit.x[0], amplitude.real(), 2e-11);
    EXPECT_NEAR(orbit.x[1], -2 * amplitude.imag(), 2e-11);
    const auto expected = std::exp(std::complex<double>(-0.1, std::sqrt(0.99)) * pi);
    ASSERT_EQ(orbit.multipliers.size(), 2);
    EXPECT_NEAR(std::abs(orbit.multipliers[0] - expected) *
                    std::abs(orbit.multipliers[0] - std::conj(expected)),
                0, 1e-11);
    EXPECT_EQ(floquet_multipliers(orbit.monodromy), orbit.multipliers);
    const Eigen::MatrixXd unknown = Eigen::MatrixXd::Constant(2, 2, std::nan(""));
    EXPECT_TRUE(floquet_multipliers(unknown).hasNaN());
    EXPECT_EQ(orbit.period, pi);
    EXPECT_EQ(orbit.run.outcome, Outcome::reached_end);
}

X2 after_period(const ImpactOscillator& oscillator, const X2& x0)
{
    return integrate(oscillator, x0, {.t_end = oscillator.period(), .rtol = 1e-13, .atol = 1e-13})
        .x;
}

// The orbit is approached for a while, then closed. The stroboscopic map is
// differentiated by five points 1e-3 apart: truncation 1e-12 of a fifth derivative of
// up to 1e4, noise 1e-12 / 1e-3. Between impacts areas shrink as exp(-0.1 t), at an
// impact by r^2, so the product of the multipliers is r^2 exp(-0.1 T).
TEST(Shooting, ImpactingOrbitsCloseAndTheirMultipliersAreThoseOfTheMap)
{
    for (const double frequency : {0.8, 0.9, 1.0, 1.1, 1.2}) {
        const ImpactOscillator oscillator({.frequency = frequency});
        const double period = oscillator.period();
        const auto approach =
            integrate(oscillator, {0.0, 0.0}, {.t_end = 20 * period, .rtol = 1e-6});
        const auto orbit = find_periodic_orbit(oscillator, approach.x,
                                               {.period = period, .tolerance = 1e-12}, fine);
        ASSERT_TRUE(orbit.converged) << frequency << describe(orbit.end);
        ASSERT_EQ(orbit.run.events.size(), 1u) << frequency;
        EXPECT_GT(orbit.iterations, 0);
        EXPECT_LE(orbit.residual, 1e-12);

        const X2 end = after_period(oscillator, orbit.x);
        EXPECT_NEAR(end[0], orbit.x[0], 1e-11) << frequency;
        EXPECT_NEAR(end[1], orbit.x[1], 1e-11) << frequency;

        Eigen::Matrix2d map;
        for (Eigen::Index j = 0; j < 2; ++j) {
            const auto moved = [&](double by) {
                X2 x = orbit.x;
                x[static_cast<std::size_t>(j)] += by;
                const X2 to = after_period(oscillator, x);
                return Eigen::Vector2d(to[0], to[1]);
            };
            const double h = 1e-3;
            map.col(j) = (8 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h);
        }
        EXPECT_LE((orbit.monodromy - map).cwiseAbs().maxCoeff(), 1e-7) << frequency;
        const Eigen::Vector2cd expected = map.eigenvalues();
        for (const std::complex<double> multiplier : orbit.multipliers) {
            const double distance =
                std::min(std::abs(multiplier - expected[0]), std::abs(multiplier - expected[1]));
            // Eigenvalues that nearly coincide move by the square root of an error.
            EXPECT_LE(distance, 1e-4) << frequency;
        }
        const std::complex<double> product = orbit.multipliers[0] * orbit.multipliers[1];
        EXPECT_NEAR(product.real(), 0.64 * std::exp(-0.1 * period), 1e-10) << frequency;
        EXPECT_NEAR(product.imag(), 0, 1e-10) << frequency;
        EXPECT_GE(std::abs(orbit.multipliers[0]), std::abs(orbit.multipliers[1]));
    }
}

// --- autonomous ---

/// x'' - (1 - x^2) x' + x = 0, with the divergence of the flow added up in z.
struct VanDerPol {
    using State = X2;
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = (1 - x[0] * x[0]) * x[1] - x[0];
        if (x.size() == 3) dxdt[2] = 1 - x[0] * x[0];
    }
};

// The period of the limit cycle is 6.66328685932312, found also by Fehlberg's method of
// order 8 at tolerances from 1e-12 to 3e-14, which differ by 1e-13. By Liouville's formula
// the product of the multipliers, of which one is 1, is the exponential of the divergence
// along the orbit.
TEST(Shooting, TheLimitCycleOfVanDerPolHasItsPeriodAndMultipliers)
{
    const auto orbit = find_periodic_orbit(
        VanDerPol{}, {2.0, 0.1}, {.period = 6.5, .autonomous = true, .tolerance = 1e-12}, fine);
    ASSERT_TRUE(orbit.converged) << describe(orbit.end);
    EXPECT_NEAR(orbit.period, 6.66328685932312, 1e-10);
    const std::array<double, 3> start{orbit.x[0], orbit.x[1], 0};
    const auto divergence =
        integrate(VanDerPol{}, start, {.t_end = orbit.period, .rtol = 1e-12, .atol = 1e-13});
    EXPECT_NEAR(std::abs(orbit.multipliers[0] - 1.0), 0, 1e-9);
    EXPECT_NEAR(orbit.multipliers[1].real(), std::exp(divergence.x[2]), 1e-9);
}

struct Oscillator {
    using State = X2;
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
};

// Every start is on an orbit of period 2 pi, so the Jacobian of the orbit is singular.
// Full corrections of Newton would lead to the equilibrium at 0 in one step.
TEST(Shooting, AnOrbitInAFamilyOfOrbitsIsFound)
{
    const auto orbit = find_periodic_orbit(
        Oscillator{}, {1.0, 0.0}, {.period = 6, .autonomous = true, .tolerance = 1e-11}, fine);
    ASSERT_TRUE(orbit.converged) << describe(orbit.end);
    EXPECT_NEAR(orbit.period, 2 * pi, 1e-10);
    EXPECT_NEAR(std::hypot(orbit.x[0], orbit.x[1]), 1, 0.1);
    EXPECT_NEAR(std::abs(orbit.multipliers[0] - 1.0), 0, 1e-5);  // a double root
}

/// A mass on a belt of speed 0.2 with the friction 1 / (1 + 3 s) at the sliding speed s;
/// it slips back (mode 0) or sticks (mode 1).
struct StickSlip {
    using State = X2;
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;
    static constexpr double belt = 0.2;

    template <class X>
    void flow(Mode mode, double, const X& x, X& dxdt) const
    {
        dxdt[0] = mode == 0 ? x[1] : belt;
        dxdt[1] = mode == 0 ? 1 / (1 + 3 * (belt - x[1])) - x[0] : 0;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? belt - x[1] : 1 - x[0];
    }
    [[nodiscard]] static bool enabled(std::size_t which, Mode mode) { return which == mode; }
    template <class X>
    [[nodiscard]] Mode reset(std::size_t which, Mode, double, X& x) const
    {
        x[1] = belt;
        if (which == 1) x[0] = 1;
        return which == 0 ? 1 : 0;
    }
};

void expect_stick_slip(const PeriodicOrbit<X2>& orbit)
{
    ASSERT_TRUE(orbit.converged) << describe(orbit.end);
    EXPECT_LE(orbit.residual, 1e-11);
    // A Taylor series of high order in 34 digits; the method's error over 12 s at rtol
    // 1e-12 is of this size.
    EXPECT_NEAR(orbit.period, 12.001031294830578647, 2e-11);
    EXPECT_EQ(orbit.run.events.size(), 2u);
    // Sticking makes the motion independent of how the belt's speed was reached.
    EXPECT_NEAR(std::abs(orbit.multipliers[0] - 1.0), 0, 1e-8);
    EXPECT_NEAR(std::abs(orbit.multipliers[1]), 0, 1e-10);
}

TEST(Shooting, TheStickSlipOrbitIsFoundWhileSticking)
{
    Options options = fine;
    options.mode = 1;
    const auto orbit = find_periodic_orbit(
        StickSlip{}, {0.5, 0.2}, {.period = 11, .autonomous = true, .tolerance = 1e-11}, options);
    expect_stick_slip(orbit);
}

TEST(Shooting, TheStickSlipOrbitIsFoundWhileSlipping)
{
    const auto orbit = find_periodic_orbit(
        StickSlip{}, {1.1, 0.0}, {.period = 12, .autonomous = true, .tolerance = 1e-11}, fine);
    expect_stick_slip(orbit);
}

/// x' = -x / 2 down to `low`, x' = 1 - x / 3 up to 2.
struct TwoModes {
    using State = X1;
    double low = 1;
    static constexpr std::size_t guard_count = 2;

    template <class X>
    void flow(Mode mode, double, const X& x, X& dxdt) const
    {
        dxdt[0] = mode == 0 ? -x[0] / 2 : 1 - x[0] / 3;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? x[0] - low : 2 - x[0];
    }
    [[nodiscard]] static bool enabled(std::size_t which, Mode mode) { return which == mode; }
    template <class X>
    [[nodiscard]] Mode reset(std::size_t which, Mode, double, X&) const
    {
        return which == 0 ? 1 : 0;
    }
};

// Down in 2 log 2, up in 3 log(2 / 1). In one dimension the only direction is
// along the orbit.
TEST(Shooting, TheOrbitOfATwoModeSwitchHasTheClosedFormPeriod)
{
    const auto orbit =
        find_periodic_orbit(TwoModes{}, {1.5}, {.period = 3, .autonomous = true}, fine);
    ASSERT_TRUE(orbit.converged) << describe(orbit.end);
    EXPECT_NEAR(orbit.period, 5 * std::log(2.0), 1e-9);
    EXPECT_NEAR(std::abs(orbit.multipliers[0] - 1.0), 0, 1e-9);
}

// --- cases without an orbit, or without a way to find it ---

/// x'' + x' + x = 0.
struct Damped {
    using State = X2;
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0] - x[1];
    }
};

TEST(Shooting, StandingStillIsNoOrbit)
{
    const auto orbit =
        find_periodic_orbit(Damped{}, {1.0, 0.0}, {.period = 7, .autonomous = true}, fine);
    EXPECT_FALSE(orbit.converged);
    EXPECT_EQ(orbit.end, ShootingEnd::equilibrium);
    EXPECT_NEAR(orbit.x[0], 0, 1e-8);
}

/// x' = 1.
struct Drift {
    using State = X1;
    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = 1;
    }
};

TEST(Shooting, AMotionThatNeverReturnsIsSaidToBeStalled)
{
    const auto orbit = find_periodic_orbit(Drift{}, {0.0}, {.period = 2}, fine);
    EXPECT_FALSE(orbit.converged);
    EXPECT_EQ(orbit.end, ShootingEnd::stalled);
    EXPECT_NEAR(orbit.residual, 2, 1e-12);
    EXPECT_EQ(orbit.x[0], 0);
}

TEST(Shooting, TheNumberOfCorrectionsIsBounded)
{
    const auto orbit = find_periodic_orbit(
        VanDerPol{}, {1.0, 0.1},
        {.period = 6.5, .autonomous = true, .tolerance = 1e-12, .max_iterations = 1}, fine);
    EXPECT_FALSE(orbit.converged);
    EXPECT_EQ(orbit.end, ShootingEnd::iteration_limit);
    EXPECT_EQ(orbit.iterations, 1);
    EXPECT_TRUE(std::isfinite(orbit.residual));
}

/// A ball without a rest rule.
struct RestlessBall {
    using State = X2;
    double force = 0;  // a lift that follows cos(t)
    static constexpr bool unilateral = true;
    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = force * std::cos(t) - 9.81;
    }
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        return x[0];
    }
    template <class X>
    void reset(double, X& x) const
    {
        x[0] = 0;
        x[1] *= -0.5;
    }
};

TEST(Shooting, ARunThatEndsEarlyIsSaidToHaveEnded)
{
    const auto orbit = find_periodic_orbit(RestlessBall{}, {1.0, 0.0}, {.period = 20}, fine);
    EXPECT_FALSE(orbit.converged);
    EXPECT_EQ(orbit.end, ShootingEnd::run_ended);
    EXPECT_EQ(orbit.run.outcome, Outcome::zeno);
    EXPECT_TRUE(std::isnan(orbit.residual));
    EXPECT_TRUE(std::isnan(orbit.multipliers[0].real()));
}

// A forced bouncing ball from far away: corrections lead below the floor, where no run
// can start, and are shortened instead of throwing.
TEST(Shooting, CorrectionsThatLeadOutsideTheModeAreShortened)
{
    const auto orbit = find_periodic_orbit(RestlessBall{.force = 3}, {0.01, 0.5},
                                           {.period = 0.3, .max_iterations = 5}, fine);
    EXPECT_GE(orbit.x[0], 0);
    EXPECT_FALSE(orbit.converged);
}

// 1.5 in mode 0 is at 1 after 2 log 1.5 = 0.81, and on its way up at 1.2.
TEST(Shooting, AnEndInAnotherModeIsSaidToBeThat)
{
    const auto orbit =
        find_periodic_orbit(TwoModes{}, {1.5}, {.period = 1.2, .autonomous = true}, fine);
    EXPECT_FALSE(orbit.converged);
    EXPECT_EQ(orbit.end, ShootingEnd::other_mode);
}

/// An oscillator that reaches the wall at 1 with no speed.
struct Grazing : Oscillator {
    static constexpr std::size_t guard_count = 1;
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.touch = 1e-9}; }
    template <class X>
    [[nodiscard]] double guard(std::size_t, double, const X& x) const
    {
        return 1 - x[0];
    }
    template <class X>
    void reset(std::size_t, double, X& x) const
    {
        x[1] *= -0.5;
    }
};

TEST(Shooting, WithoutADerivativeThereIsNoCorrection)
{
    const auto orbit = find_periodic_orbit(Grazing{}, {0.0, 1.0}, {.period = 3}, fine);
    EXPECT_FALSE(orbit.converged);
    EXPECT_EQ(orbit.end, ShootingEnd::undefined_derivative);
    EXPECT_TRUE(orbit.monodromy.array().isNaN().all());
    // The orbit of period 2 pi closes nevertheless: only its multipliers are unknown.
    const auto closed = find_periodic_orbit(Grazing{}, {0.0, 1.0}, {.period = 2 * pi}, fine);
    EXPECT_TRUE(closed.converged);
    EXPECT_TRUE(std::isnan(closed.multipliers[0].real()));
}

TEST(Shooting, SetUpsThatMakeNoSenseAreRefused)
{
    const auto refuses = [](const Shooting& shooting, const std::string& part) {
        try {
            (void)find_periodic_orbit(Oscillator{}, {1.0, 0.0}, shooting, fine);
            ADD_FAILURE() << part;
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
        }
    };
    refuses({}, "period must be positive and finite");
    refuses({.period = -1}, "period must be positive and finite");
    refuses({.period = 1, .tolerance = 0}, "tolerance must be positive");
    refuses({.period = 1, .max_iterations = -1}, "max_iterations must be zero or positive");
    // A guess behind the floor is refused.
    EXPECT_THROW((void)find_periodic_orbit(RestlessBall{}, {-1.0, 0.0}, {.period = 1}, fine),
                 std::invalid_argument);
}

TEST(Shooting, EveryEndHasANameAndASentence)
{
    for (int k = 0; k <= static_cast<int>(ShootingEnd::undefined_derivative); ++k) {
        EXPECT_NE(name(static_cast<ShootingEnd>(k)), "unknown");
        EXPECT_GT(describe(static_cast<ShootingEnd>(k)).size(), 10u);
    }
    EXPECT_EQ(name(ShootingEnd::stalled), "stalled");
}

}  // namespace
}  // namespace ricochet::shooting_test
