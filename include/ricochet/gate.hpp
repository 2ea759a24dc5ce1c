// A trained gate: the predictions of a network about the guards of a system, for several steps.
//
//     horizon gate   one output for each horizon: no guard has its event within so many seconds
//     level gate     one output, lower bounds of one guard in its own units
//
// A gate proves nothing. Its use is described at `Calibrated`, and the frequency of its errors at
// `Calibration`.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/gate_features.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

namespace detail {

/// @throws std::invalid_argument: the model is for another system.
void check_gate_system(const Model& model, std::string_view name);
/// @throws std::invalid_argument: the model was trained for another value.
void check_gate_parameter(const Model& model, std::string_view name, double trained,
                          std::optional<double> value);
/// @throws std::invalid_argument: the model takes other features, or distinguishes other modes.
void check_gate_layout(const Model& model, const GateRecipe& recipe, std::size_t features,
                       std::size_t modes);
/// @throws std::invalid_argument: the model has no box, or more features than a gate may.
void check_certified(const Model& model);

/// Name and parameters, where the system declares them.
template <class System>
void check_gate_model(const Model& model, const System& system)
{
    if constexpr (requires { std::string_view(system.name); }) {
        check_gate_system(model, system.name);
    }
    if constexpr (requires { system.parameter(std::string_view()); }) {
        for (const auto& [name, trained] : model.parameters) {
            check_gate_parameter(model, name, trained, system.parameter(std::string_view(name)));
        }
    }
}

}  // namespace detail

namespace gates {

/// A trained gate. Immutable, shared by threads and copies; evaluating it allocates nothing.
class Gate {
public:
    /// @throws std::invalid_argument if the model is no gate, its levels do not fit its outputs or
    /// do not rise, it has no domain, or its recipe is unknown.
    explicit Gate(Model model);

    [[nodiscard]] const Model& model() const noexcept { return classifier_->model(); }
    [[nodiscard]] const GateRecipe& recipe() const noexcept { return recipe_; }
    [[nodiscard]] bool is_horizon() const noexcept { return horizon_; }

    /// The largest value that is cleared: a horizon [s], with which all shorter ones are cleared
    /// too, or a level. 0: none. NaN is never cleared.
    [[nodiscard]] double cleared(const double* features) const noexcept;

    /// Whether the features lie in the box of the model, outside of which nothing is cleared.
    [[nodiscard]] bool in_domain(const double* features) const noexcept
    {
        return classifier_->in_domain(features);
    }

    /// Answer of the gate about a state.
    struct Answer {
        double cleared = 0;
        bool outside = false;  ///< outside the domain, where nothing is cleared
    };

    /// Computes the features of the state and asks the gate; allocates nothing.
    template <class System, class X>
    [[nodiscard]] Answer ask(const System& system, Mode mode, double t, const X& x) const
    {
        std::array<double, GateRecipe::most> features;
        recipe_.write(system, mode, t, x, features.data());
        if (!in_domain(features.data())) return {.outside = true};
        return {.cleared = cleared(features.data())};
    }

    /// Checks whether the gate applies to `system`, in steps between `smallest` and `largest`
    /// [s], at least in some of them. A system without a name is accepted as the right one;
    /// parameters are compared where the system declares them.
    ///
    /// @throws std::invalid_argument naming the value of the model and the one expected.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        detail::check_gate_model(model(), system);
        detail::check_gate_layout(model(), recipe_, feature_count(recipe_, system, x),
                                  mode_count_of(system));
        check_step(smallest, largest);
    }

private:
    void check_step(double smallest, double largest) const;

    detail::Shared<Classifier> classifier_;
    GateRecipe recipe_;
    bool horizon_;
};

}  // namespace gates

}  // namespace ricochet
