#include "ricochet/systems/thermostat.hpp"

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { rate, ambient, heated, low, high, temperature };  // the order of parameters

Thermostat system(const std::vector<double>& p)
{
    return Thermostat({.rate = p[rate],
                       .ambient = p[ambient],
                       .heated = p[heated],
                       .low = p[low],
                       .high = p[high]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[temperature]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

std::vector<double> exact_events(const std::vector<double>& p, double t_end)
{
    const Thermostat thermostat = system(p);
    std::vector<double> times;
    for (int n = 0; thermostat.switch_time(n, p[temperature]) <= t_end; ++n) {
        times.push_back(thermostat.switch_time(n, p[temperature]));
    }
    return times;
}

}  // namespace

SystemEntry thermostat_entry()
{
    return {
        .name = Thermostat::name,
        .description = "A heater is switched on and off by the temperature of its room.",
        .source =
            "R. Alur et al., The algorithmic analysis of hybrid systems, Theoretical "
            "Computer Science 138, 1995",
        .parameters = {{.name = "rate",
                        .initial = 0.1,
                        .unit = "1/s",
                        .range = {.lower = 0},
                        .meaning = "at which the room follows"},
                       {.name = "ambient",
                        .initial = 0,
                        .unit = "°",
                        .range = {},
                        .meaning = "temperature that the room cools to, below low"},
                       {.name = "heated",
                        .initial = 30,
                        .unit = "°",
                        .range = {},
                        .meaning = "temperature that it warms to, above high"},
                       {.name = "low",
                        .initial = 18,
                        .unit = "°",
                        .range = {},
                        .meaning = "temperature where the heater is switched on"},
                       {.name = "high",
                        .initial = 22,
                        .unit = "°",
                        .range = {},
                        .meaning = "temperature where it is switched off"},
                       {.name = "temperature",
                        .initial = Thermostat::start[0],
                        .unit = "°",
                        .range = {},
                        .meaning = "at the start, heater off"}},
        .state = {{.name = "x", .unit = "°", .meaning = "temperature"}},
        .guards = labels(Thermostat{}, {"heater on", "heater off"}),
        .modes = mode_names<Thermostat>(),
        .t_end = 20,
        .start = start,
        .run = run,
        .exact_events = exact_events,
        .comparison_step = 0.1,
    };
}

}  // namespace ricochet::app
