// Rules that choose the next step: classical ones, and a network that changes their proposal.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "ricochet/nn/mlp.hpp"
#include "ricochet/step_control.hpp"

namespace ricochet {

// Rules that choose the next step from the errors of the last ones.
//
// A controller is a value. It receives every attempt, either the error of a step,
// scaled so that 1 is just acceptable, or the fact that the step could not be computed, and decides
// whether the step is accepted and by which factor the next one differs:
//
//     StepVerdict judge(error, h)      error >= 0, finite; h was the step
//     double failed()                  factor after a step that had no solution
//     void reset()                     forgets the past, as after a jump of the motion
//
// Some of these rules accept steps of an error above 1, and some reject below it.

/// Decision of a step controller: whether the step is accepted, and the factor of the next length.
struct StepVerdict {
    bool accepted = true;
    double factor = 1;  ///< length of the next step over this one
};

/// Keeps every step as long as the first. A step without a solution is halved, and the length
/// is then restored step by step.
struct ConstantStep {
    [[nodiscard]] static StepVerdict judge(double /*error*/, double /*h*/) noexcept { return {}; }
    [[nodiscard]] static double failed() noexcept { return 0.5; }
    static void reset() noexcept {}
};

/// `ErrorRule`, of the smooth steppers, for an error proportional to h^order.
///
/// Where the motion has kinks the error of a step across one falls only like h, and
/// rejecting it costs more than it gains: with `reject_above` = 100 such a step is
/// taken, and the next is shorter.
struct ErrorStep {
    int order = 3;            ///< order of a local error: one more than that of the method
    double reject_above = 1;  ///< at least 1
    ErrorRule rule{};

    [[nodiscard]] StepVerdict judge(double error, double h) const noexcept;
    [[nodiscard]] double failed() const noexcept { return 0.5; }
    void reset() const noexcept {}
};

/// The heuristic of D. M. Riley and others (Reinforcement Learning-based adaptive
/// time-integration for nonsmooth dynamics, eq. 5 and table 2), with q = 1 / (order + 1):
///
///     error <= 1    accepted, factor min(up, error^-q)
///     error > 1     rejected, factor error^-q
///     no solution   factor down
///
/// As printed, the first case calls a step of error > 1 successful, and the second has the
/// remaining time inside a maximum; both are taken to be misprints.
struct HeuristicStep {
    int order = 1;
    double up = 2;
    double down = 0.6;

    [[nodiscard]] StepVerdict judge(double error, double h) const noexcept;
    [[nodiscard]] double failed() const noexcept { return down; }
    void reset() const noexcept {}
};

/// Rule that the published code of the same authors calls a heuristic: a step is accepted where
/// error <= 1, with the factor
///
///     0.9 error^(-0.7 / (order + 1)) error_before^(-0.4 / (order + 1)) in [down, up],
///
/// 0.9 error^(-1 / (order + 1)) at the first step; rejected otherwise, with the factor
/// down. (The sign of the second exponent is the opposite of Gustafsson's.)
struct ClassicStep {
    int order = 1;
    double safety = 0.9;
    double up = 2;
    double down = 0.6;

    [[nodiscard]] StepVerdict judge(double error, double h) noexcept;
    [[nodiscard]] double failed() const noexcept { return down; }
    void reset() noexcept { error_before = 0; }

    double error_before = 0;  ///< memory; 0: none
};

/// Eq. 6 of the same paper as printed, with the constants of its table 3:
///
///     factor = error^(-q / gamma1) error_before^(q / gamma2) (h / h_before)^-kappa
///
/// rejected if that is below c1; limited to c2. With equal gammas only the ratio of
/// two errors enters: nothing drives the error to 1, and with c1 = 1.8 a step is accepted
/// only if the next may be nearly twice as long. It is included for comparison; use
/// `FilteredStep`. A rejected step is cut to 0.6 at most, so that it cannot repeat
/// forever.
struct PrintedPiStep {
    int order = 1;
    double gamma1 = 1.0 / 6;
    double gamma2 = 1.0 / 6;
    double kappa = 1.0 / 6;
    double c1 = 1.8;
    double c2 = 2.2;

    [[nodiscard]] StepVerdict judge(double error, double h) noexcept;
    [[nodiscard]] double failed() const noexcept { return 0.6; }
    void reset() noexcept { error_before = h_before = 0; }

    double error_before = 0;  ///< memory; 0: none
    double h_before = 0;
};

/// A digital filter (G. Söderlind, Digital filters in adaptive time-stepping, ACM
/// Transactions on Mathematical Software 29, 2003): with k = order + 1
///
///     factor = error^(-beta1 / k) error_before^(-beta2 / k) factor_before^-alpha
///
/// rejected below `least`, with the factor `down`; limited to `most`. After three
/// rejections in a row the past is forgotten. The defaults are h211b with b = 4, which
/// the code of the paper above runs as its PI control.
struct FilteredStep {
    double beta1 = 0.25;
    double beta2 = 0.25;
    double alpha = 0.25;
    int order = 1;
    double least = 0.8;
    double most = 1.2;
    double down = 0.8;

    /// h211b; b from 2 to 8, the larger the smoother.
    [[nodiscard]] static FilteredStep h211b(double b) noexcept;
    [[nodiscard]] static FilteredStep h211pi() noexcept;      ///< 1/6, 1/6, 0
    [[nodiscard]] static FilteredStep pi3040() noexcept;      ///< 0.7, -0.4, 0
    [[nodiscard]] static FilteredStep pi3333() noexcept;      ///< 2/3, -1/3, 0
    [[nodiscard]] static FilteredStep pi4020() noexcept;      ///< 0.6, -0.2, 0
    [[nodiscard]] static FilteredStep elementary() noexcept;  ///< 1, 0, 0

    [[nodiscard]] StepVerdict judge(double error, double h) noexcept;
    [[nodiscard]] double failed() noexcept;
    void reset() noexcept { error_before = factor_before = 1, rejections = 0; }

    double error_before = 1;  ///< of the last step, memory
    double factor_before = 1;
    int rejections = 0;
};

/// Steps of lengths that were chosen before the run, whatever their errors. The first length is the
/// run's own first step; the last one covers the remainder.
struct PrescribedSteps {
    std::shared_ptr<const std::vector<double>> lengths{};  ///< [s] positive; not null or empty

    [[nodiscard]] StepVerdict judge(double error, double h) noexcept;
    [[nodiscard]] static double failed() noexcept { return 0.5; }
    void reset() noexcept { next = 1; }

    std::size_t next = 1;  ///< memory
};

class StepPolicy;
class StepRanges;

/// Inputs of a learned rule about an attempt, besides its error.
struct StepView {
    static constexpr std::size_t state_inputs = 6;

    double tolerance = 1;  ///< tolerance to which the error was scaled
    double step = 1;       ///< the attempt's length over the system's unit of time
    double switched = 0;   ///< fraction of the reactions that left their branch in it
    std::array<double, state_inputs> state{};  ///< inputs from its end, as the system declares them
};

/// A learned rule: the factor of `plain` times that of a `StepPolicy`. A
/// step of an error above `plain.reject_above` is rejected. The factors after a rejection, and
/// where the policy returns none, are those of `plain`.
struct LearnedStep {
    std::shared_ptr<const StepPolicy> policy{};  ///< not null
    ErrorStep plain{.order = 3, .reject_above = 100};
    StepRanges* seen = nullptr;  ///< widened by every input, unless null

    [[nodiscard]] StepVerdict judge(double error, double h, const StepView& view) noexcept;
    /// Verdict of `plain`, for callers that have no `StepView`.
    [[nodiscard]] StepVerdict judge(double error, double h) noexcept;
    [[nodiscard]] double failed() const noexcept { return plain.failed(); }
    void reset() const noexcept {}

    std::uint64_t asked = 0;        ///< number of verdicts
    std::uint64_t handed_over = 0;  ///< of these, decided by `plain` alone
};

using StepController = std::variant<ConstantStep, ErrorStep, HeuristicStep, ClassicStep,
                                    PrintedPiStep, FilteredStep, PrescribedSteps, LearnedStep>;

/// The controller's verdict; `view()` is only called for a `LearnedStep`.
template <class View>
[[nodiscard]] StepVerdict judge(StepController& controller, double error, double h, View&& view)
{
    if (auto* learned = std::get_if<LearnedStep>(&controller)) {
        return learned->judge(error, h, view());
    }
    return std::visit([&](auto& rule) { return rule.judge(error, h); }, controller);
}

/// Validates the parameters of a controller.
/// @throws std::invalid_argument for an order below 1, factors that do not shrink or grow, infinite
/// or NaN exponents, a learned rule without a policy, or prescribed steps that are not positive.
void validate(const StepController& controller);

// Description of the data that a system provides to a rule that chooses steps.

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
    [[nodiscard]] std::vector<ValueRange> domain(double margin) const;

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
