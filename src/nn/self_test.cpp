#include "self_test.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

namespace ricochet::model_file {
namespace {

[[nodiscard]] double activated(Activation activation, double x) noexcept
{
    switch (activation) {
        case Activation::relu: return std::max(0.0, x);
        case Activation::tanh: return std::tanh(x);
        case Activation::softplus: return std::max(0.0, x) + std::log1p(std::exp(-std::abs(x)));
        case Activation::silu: return x / (1 + std::exp(-x));
        case Activation::sine: return std::sin(x);
    }
    return x;
}

/// Bound of the difference between two evaluations of the model, per output.
///
/// With unit roundoff u, a sum of n products and a bias in any order is off by at
/// most (n + 2) u (|W| |x| + |b|) to first order. Errors e of its input arrive as
/// |W| e, and no activation amplifies them but SiLU, by at most 1.1; 8 u |y| allows for the
/// activation itself.
/// The first e allows for features that are normalised in the network's precision.
/// Twice the bound, as both evaluations may be off.
std::vector<double> self_test_tolerance(const Model& model)
{
    const bool single = model.precision == Precision::f32;
    const double u = single ? 0x1p-24 : 0x1p-53;
    const double tiny =
        single ? std::numeric_limits<float>::min() : std::numeric_limits<double>::min();

    const std::vector<double>& features = model.self_test.input;
    std::vector<double> x(features.size());
    std::vector<double> e(features.size());
    for (std::size_t i = 0; i < features.size(); ++i) {
        const double scale = model.scale[i];
        x[i] = (features[i] - model.offset[i]) * scale;
        e[i] = 4 * u * (std::abs(features[i]) + std::abs(model.offset[i])) * std::abs(scale);
    }
    for (std::size_t k = 0; k < model.layers.size(); ++k) {
        const DenseLayer& layer = model.layers[k];
        const bool is_residual =
            std::find(model.residual.begin(), model.residual.end(), k) != model.residual.end();
        const bool last = &layer == &model.layers.back();
        std::vector<double> y(layer.outputs);
        std::vector<double> e_y(layer.outputs);
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            double sum = layer.bias[j];
            double magnitude = std::abs(layer.bias[j]);
            double inherited = 0;
            for (std::size_t i = 0; i < layer.inputs; ++i) {
                const double w = layer.weight[j * layer.inputs + i];
                sum += w * x[i];
                magnitude += std::abs(w) * (std::abs(x[i]) + e[i]);
                inherited += std::abs(w) * e[i];
            }
            y[j] = sum;
            if (!last) y[j] = activated(model.activation, sum);
            const double steepest = model.activation == Activation::silu ? 1.1 : 1;
            e_y[j] =
                steepest * (inherited + static_cast<double>(layer.inputs + 2) * u * magnitude) +
                8 * u * std::abs(y[j]) + tiny;
            if (is_residual) {
                y[j] += x[j];
                e_y[j] += e[j] + u * std::abs(y[j]);
            }
        }
        x = std::move(y);
        e = std::move(e_y);
    }
    for (double& value : e) value *= 2;
    return e;
}

}  // namespace

Outputs::Outputs(const Model& model, const Refusal& refuse)
{
    try {
        if (model.kind == "guard") {
            guard_.emplace(model);
            const std::size_t inputs = guard_->inputs();
            if (model.offset.size() != inputs || model.scale.size() != inputs) {
                refuse("offset and scale", std::to_string(inputs) + " numbers each",
                       std::to_string(model.offset.size()) + " and " +
                           std::to_string(model.scale.size()));
            }
        } else {
            classifier_.emplace(model);
        }
    } catch (const std::invalid_argument& error) {
        refuse(error.what());
    }
}

std::size_t Outputs::inputs() const noexcept
{
    return guard_ ? guard_->inputs() : classifier_->inputs();
}

std::size_t Outputs::outputs() const noexcept
{
    return guard_ ? 1 : classifier_->outputs();
}

void Outputs::evaluate(const double* features, double* out) const noexcept
{
    if (guard_) {
        *out = guard_->value(features);
    } else {
        classifier_->logits(features, out);
    }
}

void repeat_self_test(const Model& model, const Refusal& refuse)
{
    const Outputs network(model, refuse);
    std::vector<double> found(network.outputs());
    network.evaluate(model.self_test.input.data(), found.data());
    const std::vector<double> tolerance = self_test_tolerance(model);
    for (std::size_t j = 0; j < found.size(); ++j) {
        const double expected = model.self_test.output[j];
        const bool same = found[j] == expected || (std::isnan(found[j]) && std::isnan(expected));
        const bool close =
            std::isfinite(tolerance[j]) && std::abs(found[j] - expected) <= tolerance[j];
        if (!same && !close) {
            refuse("self-test: output " + std::to_string(j), decimal(expected), decimal(found[j]));
        }
    }
}

SelfTest make_self_test(const Model& model, const Refusal& refuse)
{
    const Outputs network(model, refuse);
    SelfTest test;
    for (std::size_t i = 0; i < network.inputs(); ++i) {
        const double fraction = std::fmod(0.6180339887498949 * static_cast<double>(i + 1), 1.0);
        double value = model.offset[i] + fraction / model.scale[i];
        if (i < model.domain.size()) {
            const ValueRange& range = model.domain[i];
            const double inside = range.lower + fraction * (range.upper - range.lower);
            if (std::isfinite(inside)) value = inside;
        }
        test.input.push_back(std::isfinite(value) ? value : model.offset[i]);
    }
    test.output.resize(network.outputs());
    network.evaluate(test.input.data(), test.output.data());
    return test;
}

}  // namespace ricochet::model_file
