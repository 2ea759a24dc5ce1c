// Networks in the cavern and the cave.
#include <fmt/format.h>

#include "measure_networks.hpp"
#include "problems/cave_body.hpp"
#include "problems/cavern.hpp"

namespace ricochet::bench {

namespace {

using Fixed = FixedStep<Rk4>;
using Controlled = ErrorControlled<Dopri5>;

Cavern cavern(std::size_t segments, bool skims)
{
    Cavern::Parameters p = skims ? Cavern::skimming() : Cavern::Parameters{};
    p.segments = segments;
    return Cavern(p);
}

std::string named(std::size_t segments, bool skims, const char* method)
{
    return fmt::format("cavern of {}, {}, {}", segments, skims ? "skims" : "flies", method);
}

Options every_ms(double t_end)
{
    return {.t_end = t_end, .step = 1e-3};
}
Options free_steps(double t_end)
{
    return {.t_end = t_end, .rtol = 1e-9, .atol = 1e-9};
}
Options dense(double t_end)
{
    return {.t_end = t_end, .rtol = 1e-9, .atol = 1e-9, .h_max = 1e-3};
}

}  // namespace

void add_cavern_events(std::vector<SameEvents>& scenes)
{
    for (const bool skims : {false, true}) {
        const Cavern system = cavern(10'000, skims);
        scenes.push_back(same_events<Fixed>("(a) " + named(10'000, skims, "rk4 1 ms"), "cavern",
                                            system, every_ms(100), 1e-3));
        scenes.push_back(same_events<Controlled>("(a) " + named(10'000, skims, "dopri5"), "cavern",
                                                 system, free_steps(200), 0.04));
    }
}

void add_cavern_times(std::vector<MeteredRow>& rows)
{
    for (const std::size_t segments : {100U, 10'000U, 100'000U}) {
        for (const bool skims : {false, true}) {
            const Cavern system = cavern(segments, skims);
            time_metered<Fixed>(rows, named(segments, skims, "rk4 1 ms"), system, every_ms(20),
                                1e-3, 0.3);
            if (segments == 100) continue;
            time_metered<Controlled>(rows, named(segments, skims, "dopri5"), system,
                                     free_steps(400), 0.04, 0.3);
            if (segments == 100'000) continue;
            time_metered<Controlled>(rows, named(segments, skims, "dopri5 to 1 ms"), system,
                                     dense(20), 1e-3, 0.3);
        }
    }
}

void add_cave_body_events(std::vector<SameEvents>& scenes)
{
    scenes.push_back(same_events<Fixed>("(b) cave body, rk4 2 ms", "cave-body", CaveBody{},
                                        {.t_end = 16, .step = 2e-3}, 2e-3));
}

void add_cave_body_times(std::vector<MeteredRow>& rows)
{
    const CaveBody body;
    for (const double step : {2e-3, 1e-3, 5e-4}) {
        time_metered<Fixed>(rows, fmt::format("cave body, rk4 {} ms", 1e3 * step), body,
                            {.t_end = 4e3 * step, .step = step}, step, 0.1);
    }
    time_metered<Controlled>(rows, "cave body, dopri5", body, free_steps(5), 0.02, 0.1);
}

}  // namespace ricochet::bench
