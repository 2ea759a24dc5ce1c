#include "ricochet/systems/coulomb_oscillator.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace ricochet {

CoulombOscillator::CoulombOscillator(const Parameters& p)
    : FrictionOscillator({.mass = p.mass,
                          .stiffness = p.stiffness,
                          .belt_speed = 0,
                          .friction = p.friction,
                          .static_friction = p.static_friction,
                          .weakening = 0},
                         "CoulombOscillator"),
      half_period_(std::numbers::pi * std::sqrt(p.mass / p.stiffness)),
      loss_(2 * p.friction / p.stiffness),
      reach_(p.static_friction / p.stiffness)
{
}

double CoulombOscillator::turning_time(int n) const noexcept
{
    return n * half_period_;
}

double CoulombOscillator::turning_point(int n, double from) const noexcept
{
    const double amplitude = from - n * loss_;
    return n % 2 == 0 ? amplitude : -amplitude;
}

int CoulombOscillator::stops(double from) const noexcept
{
    if (from <= reach_) return 0;
    constexpr int never = std::numeric_limits<int>::max();
    const double n = std::ceil((from - reach_) / loss_);  // infinite if there is no friction
    return n < never ? static_cast<int>(n) : never;
}

}  // namespace ricochet
