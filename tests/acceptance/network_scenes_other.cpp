// Networks on many guards, and on one without geometry.
#include <fmt/format.h>

#include "measure_networks.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/zones.hpp"

namespace ricochet::bench {

namespace {

using Fixed = FixedStep<Rk4>;
using Controlled = ErrorControlled<Dopri5>;

Options free_steps(double t_end)
{
    return {.t_end = t_end, .rtol = 1e-9, .atol = 1e-9};
}

}  // namespace

void add_other_events(std::vector<SameEvents>& scenes)
{
    scenes.push_back(same_events<Fixed>("(e) 256 zones, rk4 1 ms", "zones", Zones{},
                                        {.t_end = 30, .step = 1e-3}, 1e-3));
    scenes.push_back(
        same_events<Controlled>("(e) 256 zones, dopri5", "zones", Zones{}, free_steps(60), 0.1));
    for (const double level : {1.3, 1.55}) {
        scenes.push_back(same_events<Fixed>(fmt::format("(f) eigenvalue, level {}", level),
                                            "eigenvalue", LeastEigenvalue({.level = level}),
                                            {.t_end = 40, .step = 1e-3}, 1e-3));
    }
}

void add_other_times(std::vector<MeteredRow>& rows)
{
    const Zones zones;
    time_metered<Fixed>(rows, "256 zones, rk4 1 ms", zones, {.t_end = 60, .step = 1e-3}, 1e-3, 0.2);
    time_metered<Controlled>(rows, "256 zones, dopri5", zones, free_steps(60), 0.1, 0.2);
    for (const double level : {1.3, 1.55}) {
        time_metered<Fixed>(rows, fmt::format("eigenvalue, level {}", level),
                            LeastEigenvalue({.level = level}), {.t_end = 60, .step = 1e-3}, 1e-3,
                            0.1);
    }
}

}  // namespace ricochet::bench
