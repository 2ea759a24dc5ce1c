#include "ricochet/systems/impact_oscillator.hpp"

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

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

SystemEntry impact_oscillator_entry()
{
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
        .exact_events = exact_events,
        .comparison_step = 0.01,
    };
}

}  // namespace ricochet::app
