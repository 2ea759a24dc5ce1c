// A periodic orbit with impacts, its stability, and what its events depend on.
//
// An oscillator under a harmonic force hits a wall once in every period of the force.
// Shooting closes the orbit with the derivative of the motion through the impact, and
// the eigenvalues of that derivative say whether the orbit attracts.

#include <array>
#include <cmath>
#include <complex>
#include <cstdio>

#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/systems/impact_oscillator.hpp"

using ricochet::ImpactOscillator;

namespace {

ImpactOscillator with_frequency(double frequency)
{
    return ImpactOscillator({.frequency = frequency});
}

}  // namespace

int main()
{
    const double frequency = 0.8;
    const ImpactOscillator oscillator = with_frequency(frequency);
    const ricochet::Options options{.rtol = 1e-12, .atol = 1e-12};

    const auto orbit = ricochet::find_periodic_orbit(oscillator, {0.5, -1.5},
                                                     {.period = oscillator.period()}, options);
    std::printf("%s after %d corrections, to %.1e\n", ricochet::describe(orbit.end).data(),
                orbit.iterations, orbit.residual);
    std::printf("orbit through (%.12f, %.12f)\n", orbit.x[0], orbit.x[1]);
    for (const std::complex<double> multiplier : orbit.multipliers) {
        std::printf("multiplier %+.9f %+.9fi, size %.9f\n", multiplier.real(), multiplier.imag(),
                    std::abs(multiplier));
    }

    // Derivatives of the time of impact with respect to the start and the frequency of the force.
    ricochet::Options period = options;
    period.t_end = oscillator.period();
    const auto s = ricochet::sensitivities(
        oscillator, orbit.x, {.parameters = {{.with = with_frequency, .nominal = frequency}}},
        period);
    if (!orbit.converged || s.events.size() != 1 || s.undefined_at) return 1;
    const auto& dt = s.events[0].dt;
    std::printf(
        "impact at %.12f s; it moves by %.6f per unit of position, %.6f of velocity and "
        "%.6f of frequency\n",
        s.run.events[0].t, dt[0], dt[1], dt[2]);
    return std::abs(orbit.multipliers[0]) < 1 ? 0 : 1;
}
