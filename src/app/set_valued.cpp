#include "set_valued.hpp"

#include <fmt/format.h>

#include <utility>

namespace ricochet::app {

std::string describe_integration(const RunSettings& settings)
{
    if (!settings.set_valued) return describe_stepping(settings);
    const SetValuedSettings& chosen = *settings.set_valued;
    if (chosen.integrator == "time-stepping") {
        return fmt::format("time-stepping, step {} s", chosen.step);
    }
    if (chosen.integrator != "bathe") {
        return fmt::format("{}: {}", chosen.integrator, describe_stepping(settings));
    }
    if (chosen.controller == "constant") return fmt::format("bathe, step {} s", chosen.step);
    return fmt::format("bathe, {}, first step {} s, rtol {}, atol {}", chosen.controller,
                       chosen.step, settings.options.rtol, settings.options.atol);
}

std::string set_valued_text(const TimedRun& timed)
{
    std::string out;
    if (timed.steps) {
        const SetValuedSteps& s = *timed.steps;
        out +=
            fmt::format("\nset-valued: {} steps attempted, {} accepted, {} solves, {} iterations",
                        s.attempted, s.accepted, s.solves, s.iterations);
    }
    for (const HandOverPhase& phase : timed.phases) {
        out += fmt::format("\nfrom {} s {}: {}", phase.from,
                           phase.set_valued ? "set-valued" : "event-driven", phase.cause);
    }
    return out;
}

void add_set_valued(Json& out, const RunSettings& settings, const TimedRun& timed)
{
    if (!settings.set_valued) return;
    out["integrator"] = settings.set_valued->integrator;
    out["controller"] = settings.set_valued->controller;
    out["set_valued_step"] = settings.set_valued->step;
    if (timed.steps) {
        const SetValuedSteps& s = *timed.steps;
        out["set_valued_statistics"] = {{"attempted", s.attempted}, {"accepted", s.accepted},
                                        {"rejected", s.rejected},   {"unsolved", s.unsolved},
                                        {"solves", s.solves},       {"iterations", s.iterations},
                                        {"switches", s.switches}};
    }
    Json phases = Json::array();
    for (const HandOverPhase& phase : timed.phases) {
        phases.push_back(
            {{"from", phase.from}, {"set_valued", phase.set_valued}, {"cause", phase.cause}});
    }
    out["phases"] = std::move(phases);
}

}  // namespace ricochet::app
