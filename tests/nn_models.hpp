// Networks for the tests, and a slow evaluation for comparison.
#pragma once

#include "ricochet/nn/model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace ricochet {

/// Random weights of variance 1 / inputs, representable in float, so that float and
/// double evaluate the same network. `widths` are those of input, layers, output.
inline Model random_model(const std::vector<std::size_t>& widths, Activation activation,
                          std::uint64_t seed)
{
    std::mt19937_64 bits(seed);
    // Standard distributions differ between libraries; a sum of twelve uniform numbers does not.
    const auto normal = [&] {
        double sum = -6;
        for (int i = 0; i < 12; ++i) sum += static_cast<double>(bits() >> 11) * 0x1p-53;
        return sum;
    };
    const auto rounded = [](double x) { return static_cast<double>(static_cast<float>(x)); };
    Model model;
    model.activation = activation;
    model.seed = seed;
    for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
        DenseLayer layer{widths[k], widths[k + 1], {}, {}};
        const double scale = 1 / std::sqrt(static_cast<double>(layer.inputs));
        for (std::size_t i = 0; i < layer.inputs * layer.outputs; ++i) {
            layer.weight.push_back(rounded(scale * normal()));
        }
        for (std::size_t j = 0; j < layer.outputs; ++j) layer.bias.push_back(rounded(normal()));
        model.layers.push_back(layer);
    }
    model.offset.assign(widths.front(), 0);
    model.scale.assign(widths.front(), 1);
    model.domain.assign(widths.front(), {-1, 1});
    return model;
}

struct Reference {
    std::vector<long double> value;
    std::vector<long double> bound;  ///< of the error of an evaluation with unit roundoff u
};

/// The network by the formula, in long double, and a bound of the error of an evaluation in another
/// order and with unit roundoff u: n products and a bias give at most
/// (n + 2) u (|W| |x| + |b|), errors of x contribute |W| e, activations have a slope of at
/// most one, and our tanh has an error of 8 u.
inline Reference evaluate_by_formula(const Model& model, const std::vector<double>& input,
                                     long double u)
{
    Reference at{{input.begin(), input.end()}, std::vector<long double>(input.size())};
    for (const DenseLayer& layer : model.layers) {
        const bool last = &layer == &model.layers.back();
        Reference next;
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            long double sum = layer.bias[j];
            long double magnitude = std::abs(sum);
            long double inherited = 0;
            for (std::size_t i = 0; i < layer.inputs; ++i) {
                const long double w = layer.weight[j * layer.inputs + i];
                sum += w * at.value[i];
                magnitude += std::abs(w) * (std::abs(at.value[i]) + at.bound[i]);
                inherited += std::abs(w) * at.bound[i];
            }
            if (!last) {
                sum = model.activation == Activation::relu ? std::max(0.0L, sum) : std::tanh(sum);
            }
            next.value.push_back(sum);
            next.bound.push_back(inherited +
                                 static_cast<long double>(layer.inputs + 2) * u * magnitude +
                                 8 * u * std::abs(sum));
        }
        at = next;
    }
    return at;
}

template <class T>
inline constexpr long double unit_roundoff = std::numeric_limits<T>::epsilon() / 2;

}  // namespace ricochet
