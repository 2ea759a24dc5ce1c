// Systems of two components with one guard.
#include "../input.hpp"
#include "entries.hpp"
#include "labels.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "run_system.hpp"

namespace ricochet::app {

// --- impact oscillator ---

namespace impact_oscillator {
namespace {

enum : std::size_t { frequency, wall, restitution, damping };  // the order of parameters

ImpactOscillator system(const std::vector<double>& p)
{
    return ImpactOscillator({.frequency = p[frequency],
                             .wall = p[wall],
                             .restitution = p[restitution],
                             .damping = p[damping]});
}

std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {ImpactOscillator::start[0], ImpactOscillator::start[1]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

std::vector<double> exact_events(const std::vector<double>& p, double t_end)
{
    return system(p).impacts(t_end);
}

}  // namespace
}  // namespace impact_oscillator

SystemEntry impact_oscillator_entry()
{
    using namespace impact_oscillator;
    return {
        .name = ImpactOscillator::name,
        .description = "A forced and damped oscillator hits a wall on one side.",
        .source =
            "S. W. Shaw and P. J. Holmes, A periodically forced piecewise linear "
            "oscillator, Journal of Sound and Vibration 90, 1983, pages 129 to 155",
        .parameters =
            {{.name = "frequency",
              .initial = 0.7,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "of the force, in units of the oscillator's own"},
             {.name = "wall",
              .initial = 1,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "position of the wall"},
             {.name = "restitution",
              .initial = 0.8,
              .unit = "1",
              .range = {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
              .meaning = "Newton's coefficient, speed after over speed before"},
             {.name = "damping",
              .initial = 0.1,
              .unit = "1",
              .range = {.lower = 0, .upper = 2},
              .meaning = "twice the damping ratio"}},
        .state = {{.name = "u", .unit = "1", .meaning = "position"},
                  {.name = "v", .unit = "1", .meaning = "velocity"}},
        .guards = labels(ImpactOscillator{}, {"impact"}),
        .t_end = 100,
        .start = start,
        .run = run,
        .series = has_series<ImpactOscillator>,
        .exact_events = exact_events,
        .comparison_step = 0.01,
    };
}

// --- pendulum ---

namespace pendulum {
namespace {

enum : std::size_t { gravity, length, angle, rate };  // the order of parameters

Pendulum system(const std::vector<double>& p)
{
    return Pendulum({.gravity = p[gravity], .length = p[length]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[angle], p[rate]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

/// Events for a start from rest; others are not known.
std::vector<double> exact_events(const std::vector<double>& p, double t_end)
{
    std::vector<double> times;
    if (p[rate] != 0) {
        throw BadInput("the event times of pendulum are known from rest, expected rate = 0");
    }
    const double half_period = system(p).half_period(p[angle]);
    for (int n = 1; n * half_period <= t_end; ++n) times.push_back(n * half_period);
    return times;
}

}  // namespace
}  // namespace pendulum

SystemEntry pendulum_entry()
{
    using namespace pendulum;
    return {
        .name = Pendulum::name,
        .description =
            "A point mass on a rod swings without friction; its turning points are found.",
        .parameters = {{.name = "gravity",
                        .initial = 9.8,
                        .unit = "m/s²",
                        .range = {.lower = 0},
                        .meaning = "acceleration downward"},
                       {.name = "length",
                        .initial = 1,
                        .unit = "m",
                        .range = {.lower = 0},
                        .meaning = "of the rod"},
                       {.name = "angle",
                        .initial = Pendulum::start[0],
                        .unit = "rad",
                        .range = {.lower = -3.14, .upper = 3.14},
                        .meaning = "at the start, from the lowest point"},
                       {.name = "rate",
                        .initial = Pendulum::start[1],
                        .unit = "rad/s",
                        .range = {},
                        .meaning = "of the angle at the start"}},
        .state = {{.name = "a", .unit = "rad", .meaning = "angle"},
                  {.name = "w", .unit = "rad/s", .meaning = "rate of the angle"}},
        .guards = labels(Pendulum{}, {"turning point"}),
        .t_end = 10,
        .start = start,
        .run = run,
        .series = has_series<Pendulum>,
        .exact_events = exact_events,
        .comparison_step = 0.01,
    };
}

// --- thermostat ---

namespace thermostat {
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
}  // namespace thermostat

SystemEntry thermostat_entry()
{
    using namespace thermostat;
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
        .series = has_series<Thermostat>,
        .exact_events = exact_events,
        .comparison_step = 0.1,
    };
}

}  // namespace ricochet::app
