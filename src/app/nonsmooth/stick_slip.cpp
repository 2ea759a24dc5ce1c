#include "ricochet/systems/stick_slip.hpp"

#include "../systems/run_system.hpp"
#include "complete.hpp"
#include "friction_inclusion.hpp"

namespace ricochet::app {

namespace stick_slip {
namespace {

enum : std::size_t {
    mass,
    stiffness,
    belt_speed,
    friction,
    weakening,
    position,
    velocity
};  // the order of parameters

StickSlip system(const std::vector<double>& p)
{
    return StickSlip({.mass = p[mass],
                      .stiffness = p[stiffness],
                      .belt_speed = p[belt_speed],
                      .friction = p[friction],
                      .weakening = p[weakening]});
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
                                                     .belt_speed = p[belt_speed],
                                                     .friction = p[friction],
                                                     .static_friction = p[friction],
                                                     .weakening = p[weakening]}),
                              {p[position], p[velocity]}, settings, repeats);
    }
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

/// Known events for the default parameters.
std::vector<double> exact_events(const std::vector<double>& /*p*/, double t_end)
{
    std::vector<double> times;
    for (double t = 0; t < t_end; t += StickSlip::period) {
        if (t > 0) times.push_back(t);
        if (t + StickSlip::stick_time <= t_end) times.push_back(t + StickSlip::stick_time);
    }
    return times;
}

}  // namespace
}  // namespace stick_slip

void complete_stick_slip(SystemEntry& entry)
{
    using namespace stick_slip;
    entry.start = start;
    entry.run = run;
    entry.start_mode = start_mode;
    entry.exact_events = exact_events;
}

}  // namespace ricochet::app
