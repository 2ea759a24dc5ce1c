// Runs with gates. Only for the two steppings that gates are trained for: each is compiled with
// every kind of gate.
#include <fmt/format.h>

#include <stdexcept>

#include "any_system.hpp"
#include "input.hpp"
#include "ricochet/detect/calibrated.hpp"
#include "ricochet/detect/certified.hpp"
#include "systems/run_system.hpp"

namespace ricochet::app {

namespace {

template <class Use>
TimedRun with_gate(const RunSettings& settings, Use&& use)
{
    const Model& model = settings.gate.value();
    switch (settings.detector) {
        case DetectorKind::certified: return use(Certified<>(model));
        case DetectorKind::calibrated: {
            const gates::Gate gate(model);
            return gate.is_horizon() ? use(Calibrated<>(gate)) : use(CalibratedBounds<>(gate));
        }
        default: return use(Foreseen<>(gates::Gate(model)));
    }
}

}  // namespace

TimedRun run_gated(const BoundedSystem& system, const std::vector<double>& x0,
                   const RunSettings& settings, int repeats)
{
    const bool fixed = settings.fixed_step;
    if (settings.stepper != (fixed ? MethodName::rk4 : MethodName::dopri5)) {
        throw BadInput(
            fmt::format("gates run with rk4 in fixed steps and dopri5 under error "
                        "control, got {}",
                        describe_stepping(settings)));
    }
    const bool horizon = settings.gate->kind == "gate-horizon";
    const bool blind = settings.detector == DetectorKind::calibrated && horizon;
    if (!blind && !system.has_bounds()) {
        throw BadInput(
            fmt::format("the {} gate closes stretches by bounds, which this system does "
                        "not declare; expected --gate calibrated with a horizon gate",
                        name(settings.detector)));
    }
    try {
        return with_gate(settings, [&](const auto& detector) {
            return fixed ? run_with(system, x0, settings, repeats, FixedStep<Rk4>{}, detector)
                         : run_with(system, x0, settings, repeats, ErrorControlled<Dopri5>{},
                                    detector);
        });
    } catch (const std::invalid_argument& error) {
        throw BadInput(fmt::format("model '{}': {}", settings.model.string(), error.what()));
    }
}

}  // namespace ricochet::app
