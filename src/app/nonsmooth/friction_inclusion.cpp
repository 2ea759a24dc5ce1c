#include "friction_inclusion.hpp"

#include <fmt/format.h>

#include <array>

#include "complete.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace friction_inclusion {
namespace {

enum : std::size_t {
    law,
    mass,
    stiffness,
    belt_speed,
    friction,
    weakening,
    residual,
    position,
    velocity
};  // the order of parameters

FrictionInclusion system(const std::vector<double>& p)
{
    constexpr std::array laws{FrictionLaw::constant, FrictionLaw::hyperbolic,
                              FrictionLaw::exponential, FrictionLaw::humped};
    const auto which = static_cast<std::size_t>(p[law]);
    if (which >= laws.size() || p[law] != static_cast<double>(which)) {
        throw BadInput(
            fmt::format("law must be 0 (constant), 1 (hyperbolic), 2 (exponential) or 3 "
                        "(humped), got {}",
                        p[law]));
    }
    return FrictionInclusion({.mass = p[mass],
                              .stiffness = p[stiffness],
                              .belt_speed = p[belt_speed],
                              .friction = p[friction],
                              .weakening = p[weakening],
                              .residual = p[residual],
                              .law = laws[which]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[position], p[velocity]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_friction(system(p), {p[position], p[velocity]}, settings, repeats);
}

/// The mode for a branch of the sliding velocity, where faster than the belt is the first.
Mode oscillator_mode(Mode branch)
{
    constexpr std::array modes{FrictionOscillator::slip_right, FrictionOscillator::stick,
                               FrictionOscillator::slip_left};
    return branch < modes.size() ? modes[branch] : branch;
}

}  // namespace
}  // namespace friction_inclusion

TimedRun run_friction(const FrictionInclusion& system, const FrictionInclusion::Vector& w0,
                      const RunSettings& settings, int repeats)
{
    return run_inclusion(system, w0, settings, repeats);
}

TimedRun run_oscillator(const FrictionInclusion& system, const FrictionInclusion::Vector& w0,
                        const RunSettings& settings, int repeats)
{
    using namespace friction_inclusion;
    TimedRun timed = run_friction(system, w0, settings, repeats);
    timed.run.mode = oscillator_mode(timed.run.mode);
    for (auto& event : timed.run.events) {
        event.mode_before = oscillator_mode(event.mode_before);
        event.mode_after = oscillator_mode(event.mode_after);
    }
    return timed;
}

void complete_friction_inclusion(SystemEntry& entry)
{
    using namespace friction_inclusion;
    entry.start = start;
    entry.run = run;
}

}  // namespace ricochet::app
