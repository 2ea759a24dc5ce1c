#include "ricochet/nonsmooth/step_controllers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "base/require.hpp"

namespace ricochet {

namespace {

constexpr std::size_t hidden = 8;

/// Inputs that every system has.
constexpr std::array<StepInput, 4> common{
    {{"log_error", -1, 3}, {"log_tolerance", -5, 3}, {"log_step", -1, 2}, {"switched", 0.5, 1}}};

double log_of(double value, double least, double most) noexcept
{
    return std::clamp(std::log(std::max(value, 1e-300)), least, most);
}

std::vector<double> taken(const std::vector<double>& from, std::size_t& at, std::size_t count)
{
    const auto begin = from.begin() + static_cast<std::ptrdiff_t>(at);
    at += count;
    return {begin, begin + static_cast<std::ptrdiff_t>(count)};
}

}  // namespace

std::string StepLayout::recipe() const
{
    std::string out = fmt::format("step-inputs-{}:", version);
    for (const StepInput& input : common) out += fmt::format(" {}", input.name);
    for (const StepInput& input : state) out += fmt::format(" {}", input.name);
    return out;
}

void StepRanges::include(const Inputs& inputs) noexcept
{
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        lower_[i] = std::min(lower_[i], inputs[i]);
        upper_[i] = std::max(upper_[i], inputs[i]);
    }
}

void StepRanges::include(const StepRanges& other) noexcept
{
    for (std::size_t i = 0; i < lower_.size(); ++i) {
        lower_[i] = std::min(lower_[i], other.lower_[i]);
        upper_[i] = std::max(upper_[i], other.upper_[i]);
    }
}

std::vector<ValueRange> StepRanges::domain(double margin) const
{
    std::vector<ValueRange> out;
    if (empty()) return out;
    for (std::size_t i = 0; i < lower_.size(); ++i) {
        const double more = margin * (upper_[i] - lower_[i]);
        out.push_back({lower_[i] - more, upper_[i] + more});
    }
    return out;
}

StepPolicy::StepPolicy(Model model) : model_(std::move(model)), network_(model_)
{
    constexpr detail::Refuse refuse{"step policy"};
    if (model_.kind != kind) {
        refuse(fmt::format("the model must be of the kind \"{}\", not \"{}\"", kind, model_.kind));
    }
    if (network_.inputs() != inputs || network_.outputs() != 1) {
        refuse(fmt::format("the network must have {} inputs and 1 output, not {} and {}", inputs,
                           network_.inputs(), network_.outputs()));
    }
    if (model_.offset.size() != inputs || model_.scale.size() != inputs ||
        (!model_.domain.empty() && model_.domain.size() != inputs)) {
        refuse(fmt::format("offset, scale and domain must have {} entries, not {}, {} and {}",
                           inputs, model_.offset.size(), model_.scale.size(),
                           model_.domain.size()));
    }
}

void StepPolicy::require(const StepLayout& layout) const
{
    if (model_.system != layout.system) {
        throw std::invalid_argument(fmt::format("step policy: it is for the system {}, not for {}",
                                                model_.system, layout.system));
    }
    if (model_.recipe != layout.recipe()) {
        throw std::invalid_argument(
            fmt::format("step policy: its inputs are \"{}\", those of the system are \"{}\"",
                        model_.recipe, layout.recipe()));
    }
}

StepRanges::Inputs StepPolicy::inputs_of(double error, const StepView& view) noexcept
{
    StepRanges::Inputs out{log_of(error, -14, 5), std::log(view.tolerance), std::log(view.step),
                           view.switched};
    std::copy(view.state.begin(), view.state.end(), out.begin() + 4);
    return out;
}

std::optional<double> StepPolicy::factor(const StepRanges::Inputs& raw) const noexcept
{
    StepRanges::Inputs in{};
    for (std::size_t i = 0; i < inputs; ++i) {
        if (!model_.domain.empty()) {
            const ValueRange& range = model_.domain[i];
            if (!(raw[i] >= range.lower && raw[i] <= range.upper)) return std::nullopt;
        }
        in[i] = (raw[i] - model_.offset[i]) * model_.scale[i];
    }
    double out = 0;
    network_.forward(in.data(), &out);
    if (!std::isfinite(out)) return std::nullopt;
    return std::exp(std::clamp(out, -most, most));
}

StepVerdict LearnedStep::judge(double error, double h) noexcept
{
    ++asked;
    ++handed_over;
    return plain.judge(error, h);
}

StepVerdict LearnedStep::judge(double error, double h, const StepView& view) noexcept
{
    ++asked;
    StepVerdict verdict = plain.judge(error, h);
    std::optional<double> factor;
    if (verdict.accepted) {
        const StepRanges::Inputs inputs = StepPolicy::inputs_of(error, view);
        if (seen != nullptr) seen->include(inputs);
        factor = policy->factor(inputs);
    }
    if (factor) {
        verdict.factor *= *factor;
    } else {
        ++handed_over;
    }
    return verdict;
}

Model step_policy_model(const StepLayout& layout, const std::vector<double>& weights)
{
    if (!weights.empty() && weights.size() != step_policy_weights) {
        throw std::invalid_argument(fmt::format("step policy: expected {} weights, got {}",
                                                step_policy_weights, weights.size()));
    }
    const std::vector<double> all =
        weights.empty() ? std::vector<double>(step_policy_weights) : weights;
    Model out;
    out.kind = StepPolicy::kind;
    out.system = layout.system;
    out.recipe = layout.recipe();
    out.activation = Activation::tanh;
    out.precision = Precision::f64;
    for (std::size_t i = 0; i < StepPolicy::inputs; ++i) {
        const StepInput& input = i < common.size() ? common[i] : layout.state[i - common.size()];
        out.offset.push_back(input.centre);
        out.scale.push_back(1 / input.width);
    }
    std::size_t at = 0;
    const std::size_t widths[] = {StepPolicy::inputs, hidden, hidden, 1};
    for (std::size_t k = 0; k < 3; ++k) {
        DenseLayer layer{.inputs = widths[k], .outputs = widths[k + 1], .weight = {}, .bias = {}};
        layer.weight = taken(all, at, layer.inputs * layer.outputs);
        layer.bias = taken(all, at, layer.outputs);
        out.layers.push_back(std::move(layer));
    }
    return out;
}

}  // namespace ricochet
