#include "ricochet/systems/coulomb_oscillator.hpp"

#include "../input.hpp"
#include "../systems/run_system.hpp"
#include "complete.hpp"
#include "friction_inclusion.hpp"

namespace ricochet::app {

namespace coulomb_oscillator {
namespace {

enum : std::size_t {
    mass,
    stiffness,
    friction,
    static_friction,
    position,
    velocity
};  // the order of parameters

CoulombOscillator system(const std::vector<double>& p)
{
    return CoulombOscillator({.mass = p[mass],
                              .stiffness = p[stiffness],
                              .friction = p[friction],
                              .static_friction = p[static_friction]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[position], p[velocity]};
}

Mode start_mode(const std::vector<double>& p)
{
    return system(p).mode_at(p[position], p[velocity]);
}

TimedRun run(const RunSettings& settings, int repeats)
{
    if (settings.set_valued) {
        const auto& p = settings.parameters;
        return run_oscillator(FrictionInclusion::of({.mass = p[mass],
                                                     .stiffness = p[stiffness],
                                                     .friction = p[friction],
                                                     .static_friction = p[static_friction]}),
                              {p[position], p[velocity]}, settings, repeats);
    }
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

/// Events for a start from rest on the right; others are not known.
std::vector<double> exact_events(const std::vector<double>& p, double t_end)
{
    const CoulombOscillator oscillator = system(p);
    std::vector<double> times;
    if (p[velocity] != 0 || !(p[position] > 0) || p[friction] == 0) {
        throw BadInput(
            "the event times of coulomb-oscillator are known with friction and from rest, expected "
            "velocity = 0, position > 0 and friction > 0");
    }
    for (int n = 1; n <= oscillator.stops(p[position]) && oscillator.turning_time(n) <= t_end;
         ++n) {
        times.push_back(oscillator.turning_time(n));
    }
    return times;
}

}  // namespace
}  // namespace coulomb_oscillator

void complete_coulomb_oscillator(SystemEntry& entry)
{
    using namespace coulomb_oscillator;
    entry.start = start;
    entry.run = run;
    entry.start_mode = start_mode;
    entry.exact_events = exact_events;
}

}  // namespace ricochet::app
