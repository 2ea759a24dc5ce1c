// A network that lengthens or shortens the steps of a classical controller.
//
//     const auto policy = std::make_shared<const StepPolicy>(load_model("fault-step.safetensors"));
//     BatheOptions{.controller = LearnedStep{policy}, .estimate = ErrorEstimate::embedded}
//
// The classical proposal h 0.9 E^(-1/3) is multiplied by exp(network), held within [e^-2, e^2].
// The inputs of the network are intensive, means over a field rather than sums, so that a
// policy trained on one element serves any mesh. The policy decides only about lengths: whatever
// its weights, a step whose error is too large is rejected and repeated by the classical rule. That
// rule also decides where an input is NaN or outside of the range seen in training.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/detail/step_layout.hpp"
#include "ricochet/nn/mlp.hpp"

namespace ricochet {

/// The range of every input that was met in training.
class StepRanges {
public:
    static constexpr std::size_t inputs = 4 + StepView::state_inputs;
    using Inputs = std::array<double, inputs>;

    /// Widens the ranges to hold `inputs`, or those of `other`.
    void include(const Inputs& inputs) noexcept;
    void include(const StepRanges& other) noexcept;
    [[nodiscard]] bool empty() const noexcept { return !(lower_[0] <= upper_[0]); }
    /// One interval per input, widened by this fraction of its width on both sides.
    [[nodiscard]] std::vector<Interval> domain(double margin) const;

private:
    Inputs lower_ = filled(1);
    Inputs upper_ = filled(-1);

    static constexpr Inputs filled(double sign)
    {
        Inputs out{};
        for (double& value : out) value = sign * 1e300;
        return out;
    }
};

/// A loaded policy. Immutable; threads may share it.
class StepPolicy {
public:
    static constexpr std::string_view kind = "step-policy";
    static constexpr std::size_t inputs = StepRanges::inputs;
    static constexpr double most = 2;  ///< largest |log factor|

    /// @throws std::invalid_argument if the model is of another kind, if it does not have
    /// `inputs` inputs and one output, or as `Mlp`.
    explicit StepPolicy(Model model);

    /// @throws std::invalid_argument if the policy is for another system or layout, naming both.
    void require(const StepLayout& layout) const;

    /// Returns log E, log tolerance, log step, the fraction switched, and the inputs of the system.
    [[nodiscard]] static StepRanges::Inputs inputs_of(double error, const StepView& view) noexcept;

    /// Factor for the classical proposal, in [e^-2, e^2]. Empty if an input is
    /// outside of the domain, or the network's output is not a number.
    [[nodiscard]] std::optional<double> factor(const StepRanges::Inputs& inputs) const noexcept;

    [[nodiscard]] const Model& model() const noexcept { return model_; }

private:
    Model model_;
    Mlp<double> network_;
};

/// A model of that layout with these weights, to be trained or saved: 10-8-8-1, tanh, in double;
/// an empty list is a network that returns zero. Weights of each layer row by row, then biases.
/// @throws std::invalid_argument for another number of weights.
[[nodiscard]] Model step_policy_model(const StepLayout& layout, const std::vector<double>& weights);

/// Number of weights of that network.
inline constexpr std::size_t step_policy_weights =
    (StepPolicy::inputs + 1) * 8 + 9 * std::size_t{8} + 9;

}  // namespace ricochet
