#include "ricochet/systems/coulomb_oscillator.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <stdexcept>
#include <vector>

#include "ricochet/systems/descriptor.hpp"
#include "spring_mass.hpp"

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

const SystemDescriptor& CoulombOscillator::descriptor()
{
    using Numbers = std::span<const double>;
    static const SystemDescriptor all{
        .name = name,
        .type = "CoulombOscillator",
        .description = "A mass on a spring comes to rest under dry friction after a few turns.",
        .equations = {"slipping: mass u'' = -stiffness u - friction sign(v)",
                      "sticking: u'' = 0 while stiffness |u| <= static-friction"},
        .parameters = {detail::mass_of_oscillator(Parameters{}.mass),
                       detail::stiffness_of_spring(Parameters{}.stiffness),
                       {.name = "friction",
                        .initial = Parameters{}.friction,
                        .unit = "N",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "while slipping"},
                       {.name = "static-friction",
                        .initial = Parameters{}.static_friction,
                        .unit = "N",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "that sticking bears, at least friction"}},
        .state = detail::position_and_velocity(start),
        .events = {"stop", "pulled left", "pulled right"},
        .t_end = 10,
        .comparison_step = 0.01,
        .known = {{.name = "turning_time",
                   .meaning = "Time [s] of the n-th stop after a start at rest, n = 1, 2, ...",
                   .arguments = {{.name = "n", .whole = true}},
                   .values =
                       [](Numbers p, Numbers a) {
                           return std::vector{with_parameters<CoulombOscillator>(p).turning_time(
                               static_cast<int>(a[0]))};
                       }},
                  {.name = "turning_point",
                   .meaning = "Where [m] the n-th stop is after a start at rest at `start` [m].",
                   .arguments = {{.name = "n", .whole = true},
                                 {.name = "start", .initial = start[0]}},
                   .values =
                       [](Numbers p, Numbers a) {
                           return std::vector{with_parameters<CoulombOscillator>(p).turning_point(
                               static_cast<int>(a[0]), a[1])};
                       }}},
        .event_times = [](Numbers p, Numbers x0, double t_end) {
            const auto oscillator = with_parameters<CoulombOscillator>(p);
            const double friction = p[2];
            if (x0[1] != 0 || !(x0[0] > 0) || friction == 0) {
                throw std::invalid_argument(
                    "the event times of coulomb-oscillator are known with friction and from rest, "
                    "expected velocity = 0, position > 0 and friction > 0");
            }
            std::vector<double> times;
            for (int n = 1; n <= oscillator.stops(x0[0]) && oscillator.turning_time(n) <= t_end;
                 ++n) {
                times.push_back(oscillator.turning_time(n));
            }
            return times;
        }};
    return all;
}

}  // namespace ricochet
