// Internal: the declarations of this header may change without notice.
//
// Description of the data that a system provides to a rule that chooses steps.
#pragma once

#include <array>
#include <concepts>
#include <string>
#include <string_view>

#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet {

/// An input of a policy and its typical range. The network receives (input - `centre`) / `width`.
struct StepInput {
    std::string_view name;
    double centre = 0;
    double width = 1;
};

/// Inputs of the policies of one system.
struct StepLayout {
    std::string_view system;  ///< e.g. "fault"
    int version = 1;          ///< of the meaning of the names
    std::array<StepInput, StepView::state_inputs> state;

    /// Text in a model file: "step-inputs-1: log_error log_tolerance ...".
    [[nodiscard]] std::string recipe() const;
};

/// A system that declares inputs for policies: `step_inputs(t, w, rate, reaction, out)` at the end
/// of a step, with the rate of w there, and the unit of time [s] in which steps are measured.
template <class System, class State, class Reaction>
concept DeclaresStepInputs = requires(const System& system, double t, const State& w,
                                      const Reaction& reaction,
                                      std::array<double, StepView::state_inputs>& out)
{
    {
        System::step_layout()
        } -> std::convertible_to<const StepLayout&>;
    {
        system.step_unit()
        } -> std::convertible_to<double>;
    system.step_inputs(t, w, w, reaction, out);
};

}  // namespace ricochet
