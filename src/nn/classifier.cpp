#include "ricochet/nn/mlp.hpp"

#include <array>
#include <stdexcept>
#include <string>
#include <utility>

namespace ricochet {

Classifier::Classifier(Model model, const MlpOptions& options)
    : model_(std::move(model)), threshold_(model_.threshold)
{
    if (model_.precision == Precision::f32) {
        single_.emplace(model_, options);
    } else {
        double_.emplace(model_, options);
    }
    inputs_ = model_.layers.front().inputs;
    outputs_ = model_.layers.back().outputs;

    const auto expect_inputs = [&](const char* what, std::size_t found) {
        if (found != inputs_) {
            throw std::invalid_argument(std::string("Classifier: expected one ") + what +
                                        " for each of " + std::to_string(inputs_) +
                                        " inputs, found " + std::to_string(found));
        }
    };
    expect_inputs("offset", model_.offset.size());
    expect_inputs("scale", model_.scale.size());
    if (!model_.domain.empty()) expect_inputs("domain", model_.domain.size());
}

template <class T>
void Classifier::evaluate(const Mlp<T>& mlp, const double* features, T* out) const noexcept
{
    alignas(64) std::array<T, Mlp<T>::max_width> x;
    for (std::size_t i = 0; i < inputs_; ++i) {
        const double centred = features[i] - model_.offset[i];
        x[i] = static_cast<T>(centred * model_.scale[i]);
    }
    mlp.forward(x.data(), out);
}

void Classifier::logits(const double* features, double* out) const noexcept
{
    if (single_) {
        std::array<float, Mlp<float>::max_width> y;
        evaluate(*single_, features, y.data());
        for (std::size_t j = 0; j < outputs_; ++j) out[j] = static_cast<double>(y[j]);
    } else {
        evaluate(*double_, features, out);
    }
}

double Classifier::logit(const double* features) const noexcept
{
    std::array<double, Mlp<double>::max_width> y;
    logits(features, y.data());
    return y[0];
}

bool Classifier::in_domain(const double* features) const noexcept
{
    for (std::size_t i = 0; i < model_.domain.size(); ++i) {
        const ValueRange& range = model_.domain[i];
        if (!(range.lower <= features[i] && features[i] <= range.upper)) return false;
    }
    return true;
}

}  // namespace ricochet
