#include "ricochet/systems/pendulum.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <stdexcept>
#include <vector>

#include "base/require.hpp"
#include "ricochet/systems/descriptor.hpp"

namespace ricochet {

Pendulum::Pendulum(const Parameters& parameters)
    : stiffness_(parameters.gravity / parameters.length)
{
    detail::require_positive("Pendulum", "gravity", parameters.gravity);
    detail::require_positive("Pendulum", "length", parameters.length);
}

double Pendulum::half_period(double amplitude) const noexcept
{
    // In long double, so that the result is a reference for runs in double.
    long double a = 1;
    long double b = std::cos(static_cast<long double>(amplitude) / 2);
    while (std::fabs(a - b) > 4 * std::numeric_limits<long double>::epsilon() * a) {
        const long double mean = (a + b) / 2;
        b = std::sqrt(a * b);
        a = mean;
    }
    const long double w = std::sqrt(static_cast<long double>(stiffness_));
    return static_cast<double>(std::numbers::pi_v<long double> / (w * a));
}

const SystemDescriptor& Pendulum::descriptor()
{
    using Numbers = std::span<const double>;
    static const SystemDescriptor all{
        .name = name,
        .type = "Pendulum",
        .description =
            "A point mass on a rod swings without friction; its turning points are found.",
        .equations = {"a'' = -gravity / length sin(a)"},
        .parameters = {{.name = "gravity",
                        .initial = Parameters{}.gravity,
                        .unit = "m/s²",
                        .range = {.lower = 0},
                        .meaning = "acceleration downward"},
                       {.name = "length",
                        .initial = Parameters{}.length,
                        .unit = "m",
                        .range = {.lower = 0},
                        .meaning = "of the rod"}},
        .state = {{.name = "a",
                   .unit = "rad",
                   .meaning = "angle",
                   .title = "angle",
                   .start = start[0],
                   .start_meaning = "at the start, from the lowest point",
                   .start_range = {.lower = -3.14, .upper = 3.14}},
                  {.name = "w",
                   .unit = "rad/s",
                   .meaning = "rate of the angle",
                   .title = "rate",
                   .start = start[1],
                   .start_meaning = "of the angle at the start"}},
        .events = {"turning point"},
        .t_end = 10,
        .comparison_step = 0.01,
        .known = {{.name = "half_period",
                   .meaning = "Time [s] between turning points at +-amplitude [rad].",
                   .arguments = {{.name = "amplitude", .initial = start[0]}},
                   .values =
                       [](Numbers p, Numbers a) {
                           return std::vector{with_parameters<Pendulum>(p).half_period(a[0])};
                       }}},
        .event_times = [](Numbers p, Numbers x0, double t_end) {
            if (x0[1] != 0) {
                throw std::invalid_argument(
                    "the event times of pendulum are known from rest, expected rate = 0");
            }
            const double half_period = with_parameters<Pendulum>(p).half_period(x0[0]);
            std::vector<double> times;
            for (int n = 1; n * half_period <= t_end; ++n) times.push_back(n * half_period);
            return times;
        }};
    return all;
}

}  // namespace ricochet
