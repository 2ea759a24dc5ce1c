#include "ricochet/systems/coulomb_oscillator.hpp"

#include "../systems/ready_runs.hpp"
#include "complete.hpp"
#include "friction_inclusion.hpp"

namespace ricochet::app {

namespace coulomb_oscillator {
namespace {

using Runs = ReadyRuns<CoulombOscillator>;

TimedRun run(const RunSettings& settings, int repeats)
{
    if (!settings.set_valued) return Runs::run(settings, repeats);
    const auto p = Runs::own_parameters(settings.parameters);
    const FrictionOscillator::Parameters of{
        .mass = p[0], .stiffness = p[1], .friction = p[2], .static_friction = p[3]};
    const auto [u, v] = Runs::start(settings.parameters);
    return run_oscillator(FrictionInclusion::of(of), {u, v}, settings, repeats);
}

}  // namespace
}  // namespace coulomb_oscillator

void complete_coulomb_oscillator(SystemEntry& entry)
{
    coulomb_oscillator::Runs::give_to(entry);
    entry.run = coulomb_oscillator::run;
}

}  // namespace ricochet::app
