#include "problems/henon_heiles.hpp"

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

/// The parameters are the start.
std::vector<double> start(const std::vector<double>& p)
{
    return p;
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(HenonHeiles{}, start(settings.parameters), settings, repeats);
}

std::vector<double> exact_events(const std::vector<double>& /*p*/, double t_end)
{
    std::vector<double> times;
    for (const double t : HenonHeiles::section_times) {
        if (t <= t_end) times.push_back(t);
    }
    return times;
}

}  // namespace

SystemEntry henon_heiles_entry()
{
    return {
        .name = HenonHeiles::name,
        .description =
            "A star moves in the plane of a galaxy; its passages through a plane are found.",
        .source =
            "M. Henon and C. Heiles, The applicability of the third integral of motion: "
            "some numerical experiments, Astronomical Journal 69, 1964, pages 73 to 79",
        .parameters = {{.name = "vx",
                        .initial = HenonHeiles::start[0],
                        .unit = "1",
                        .range = {},
                        .meaning = "velocity at the start"},
                       {.name = "vy",
                        .initial = HenonHeiles::start[1],
                        .unit = "1",
                        .range = {},
                        .meaning = "velocity at the start"},
                       {.name = "x",
                        .initial = HenonHeiles::start[2],
                        .unit = "1",
                        .range = {},
                        .meaning = "position at the start"},
                       {.name = "y",
                        .initial = HenonHeiles::start[3],
                        .unit = "1",
                        .range = {},
                        .meaning = "position at the start"}},
        .state = {{.name = "vx", .unit = "1", .meaning = "velocity along x"},
                  {.name = "vy", .unit = "1", .meaning = "velocity along y"},
                  {.name = "x", .unit = "1", .meaning = "position"},
                  {.name = "y", .unit = "1", .meaning = "position"}},
        .guards = labels(HenonHeiles{}, {"passage"}),
        .t_end = 35,
        .start = start,
        .run = run,
        .exact_events = exact_events,
        .numerical_reference = true,
        .any_parameters = false,
        .comparison_step = 0.01,
    };
}

}  // namespace ricochet::app
