#include "ricochet/systems/stick_slip.hpp"

#include "../systems/ready_runs.hpp"
#include "complete.hpp"
#include "friction_inclusion.hpp"

namespace ricochet::app {

namespace stick_slip {
namespace {

using Runs = ReadyRuns<StickSlip>;

TimedRun run(const RunSettings& settings, int repeats)
{
    if (!settings.set_valued) return Runs::run(settings, repeats);
    const auto p = Runs::own_parameters(settings.parameters);
    const FrictionOscillator::Parameters of{.mass = p[0],
                                            .stiffness = p[1],
                                            .belt_speed = p[2],
                                            .friction = p[3],
                                            .static_friction = p[3],
                                            .weakening = p[4]};
    const auto [u, v] = Runs::start(settings.parameters);
    return run_oscillator(FrictionInclusion::of(of), {u, v}, settings, repeats);
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
    stick_slip::Runs::give_to(entry);
    entry.run = stick_slip::run;
    entry.exact_events = stick_slip::exact_events;
}

}  // namespace ricochet::app
