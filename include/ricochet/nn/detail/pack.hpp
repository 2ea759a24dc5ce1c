// Internal: the declarations of this header may change without notice.
//
// Converts a Model to the padded parameters that the kernels read.
#pragma once

#include "ricochet/nn/detail/kernel.hpp"
#include "ricochet/nn/model.hpp"

#include <cstddef>
#include <string_view>

namespace ricochet::detail {

/// How large a network may be.
struct LayerLimits {
    std::size_t layers = 64;
    std::size_t width = 256;  ///< of each layer and of the input
};

/// @throws std::invalid_argument in the name of `who` if the model has no layer or more than the
/// limit, if a width is zero or above its limit, if the inputs of a layer are not the outputs of
/// the one before it, or if the number of weights or biases does not match its shape.
void check_layers(const Model& model, std::string_view who, const LayerLimits& limits = {});

namespace RICOCHET_KERNEL_NAMESPACE {

/// Number of values that `pack` writes.
template <class T>
[[nodiscard]] std::size_t packed_size(const Model& model) noexcept
{
    std::size_t size = 0;
    for (const DenseLayer& layer : model.layers) {
        size += layer_size<T>(layer.inputs, layer.outputs, &layer == &model.layers.back());
    }
    return size;
}

/// Rounds the parameters of checked layers to T and stores them as `layer_size`
/// describes, with zeros for padding.
template <class T>
void pack(const Model& model, T* to) noexcept
{
    for (const DenseLayer& layer : model.layers) {
        const bool is_last = &layer == &model.layers.back();
        const std::size_t size = layer_size<T>(layer.inputs, layer.outputs, is_last);
        for (std::size_t i = 0; i < size; ++i) to[i] = 0;
        if (is_last && layer.outputs == 1) {
            for (std::size_t i = 0; i < layer.inputs; ++i) to[i] = static_cast<T>(layer.weight[i]);
            to[padded<T>(layer.inputs)] = static_cast<T>(layer.bias[0]);
        } else {
            const std::size_t row = padded<T>(layer.outputs);
            for (std::size_t j = 0; j < layer.outputs; ++j) {
                to[j] = static_cast<T>(layer.bias[j]);
                for (std::size_t i = 0; i < layer.inputs; ++i) {
                    to[(i + 1) * row + j] = static_cast<T>(layer.weight[j * layer.inputs + i]);
                }
            }
        }
        to += size;
    }
}

}  // namespace RICOCHET_KERNEL_NAMESPACE
}  // namespace ricochet::detail
