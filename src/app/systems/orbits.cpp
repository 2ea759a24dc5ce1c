// Sections of orbits.
#include "entries.hpp"
#include "labels.hpp"
#include "problems/henon_heiles.hpp"
#include "problems/three_body.hpp"
#include "run_system.hpp"

namespace ricochet::app {

// --- henon heiles ---

namespace henon_heiles {
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
}  // namespace henon_heiles

SystemEntry henon_heiles_entry()
{
    using namespace henon_heiles;
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
        .series = has_series<HenonHeiles>,
        .exact_events = exact_events,
        .numerical_reference = true,
        .any_parameters = false,
        .comparison_step = 0.01,
    };
}

// --- three body ---

namespace three_body {
namespace {

enum : std::size_t { mass_ratio, vx, vy };  // the order of parameters

ThreeBody system(const std::vector<double>& p)
{
    return ThreeBody({.mass_ratio = p[mass_ratio]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {ThreeBody::start[0], ThreeBody::start[1], p[vx], p[vy]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

std::vector<double> exact_events(const std::vector<double>& /*p*/, double t_end)
{
    std::vector<double> times;
    for (const double t : {ThreeBody::farthest_time, ThreeBody::return_time}) {
        if (t <= t_end) times.push_back(t);
    }
    return times;
}

}  // namespace
}  // namespace three_body

SystemEntry three_body_entry()
{
    using namespace three_body;
    return {
        .name = ThreeBody::name,
        .description =
            "A spacecraft circles Earth and Moon; where it is farthest from its start and back "
            "there is found.",
        .source =
            "L. F. Shampine and M. K. Gordon, Computer solution of ordinary differential "
            "equations: the initial value problem, Freeman, 1975, page 246",
        .parameters = {{.name = "mass-ratio",
                        .initial = 1 / 82.45,
                        .unit = "1",
                        .range = {.lower = 0, .upper = 0.5, .upper_included = true},
                        .meaning = "Moon over Earth and Moon"},
                       {.name = "vx",
                        .initial = ThreeBody::start[2],
                        .unit = "1",
                        .range = {},
                        .meaning = "velocity at the start"},
                       {.name = "vy",
                        .initial = ThreeBody::start[3],
                        .unit = "1",
                        .range = {},
                        .meaning = "velocity at the start"}},
        .state = {{.name = "x", .unit = "1", .meaning = "position"},
                  {.name = "y", .unit = "1", .meaning = "position"},
                  {.name = "vx", .unit = "1", .meaning = "velocity along x"},
                  {.name = "vy", .unit = "1", .meaning = "velocity along y"}},
        .guards = labels(ThreeBody{}, {"farthest or nearest"}),
        .t_end = 6.2,
        .start = start,
        .run = run,
        .series = has_series<ThreeBody>,
        .exact_events = exact_events,
        .numerical_reference = true,
        .any_parameters = false,
        .comparison_step = 0.0005,
    };
}

}  // namespace ricochet::app
