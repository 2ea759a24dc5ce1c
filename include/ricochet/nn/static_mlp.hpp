// Evaluation of a multilayer perceptron whose shape is known at compile time.
//
// Compiled with the caller's flags, e.g. -O2 -march=x86-64-v3, and inlined. The
// result has the same bits as that of `Mlp`, whatever the flags, but for those that
// give up IEEE arithmetic (-ffast-math).
#pragma once

#include "ricochet/detail/pack.hpp"

#include <array>
#include <cstddef>
#include <stdexcept>
#include <string>

namespace ricochet {

/// A network with `Widths` values between its layers, the inputs first and the
/// outputs last, in the arithmetic of T, float or double. A value, so it may be
/// copied, and shared by threads.
template <Activation activation, class T, std::size_t... Widths>
class BasicStaticMlp {
    static_assert(sizeof...(Widths) >= 2, "inputs and outputs at least");
    static_assert(((Widths > 0 && Widths <= 256) && ...), "widths from 1 to 256");

public:
    /// @throws std::invalid_argument if the model has another shape or activation.
    explicit BasicStaticMlp(const Model& model)
    {
        detail::check_layers(model, "StaticMlp");
        if (model.activation != activation) {
            throw std::invalid_argument("StaticMlp: the model has another activation");
        }
        if (model.layers.size() != widths.size() - 1) {
            throw std::invalid_argument("StaticMlp: expected " + std::to_string(widths.size() - 1) +
                                        " layers, found " + std::to_string(model.layers.size()));
        }
        for (std::size_t k = 0; k < model.layers.size(); ++k) {
            const DenseLayer& layer = model.layers[k];
            if (layer.inputs != widths[k] || layer.outputs != widths[k + 1]) {
                throw std::invalid_argument(
                    "StaticMlp: expected layer " + std::to_string(k) + " of shape " +
                    std::to_string(widths[k + 1]) + " x " + std::to_string(widths[k]) + ", found " +
                    std::to_string(layer.outputs) + " x " + std::to_string(layer.inputs));
            }
        }
        detail::RICOCHET_KERNEL_NAMESPACE::pack(model, parameters_.data());
    }

    // Inlined without exception, so that translation units with different flags do
    // not share one definition; the same holds for all it calls.
    /// Reads `inputs()` values and writes `outputs()`.
    RICOCHET_INLINE void forward(const T* in, T* out) const noexcept
    {
        detail::RICOCHET_KERNEL_NAMESPACE::evaluate<T, activation == Activation::relu, Widths...>(
            parameters_.data(), in, out);
    }

    /// Reads `samples` rows of inputs, and writes as many rows of outputs.
    RICOCHET_INLINE void forward_batch(const T* in, std::size_t samples, T* out) const noexcept
    {
        for (std::size_t i = 0; i < samples; ++i) {
            forward(in + i * widths.front(), out + i * widths.back());
        }
    }

    [[nodiscard]] static constexpr std::size_t inputs() noexcept { return widths.front(); }
    [[nodiscard]] static constexpr std::size_t outputs() noexcept { return widths.back(); }

private:
    static constexpr std::array<std::size_t, sizeof...(Widths)> widths{Widths...};

    static constexpr std::size_t size()
    {
        std::size_t sum = 0;
        for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
            sum += detail::RICOCHET_KERNEL_NAMESPACE::layer_size<T>(widths[k], widths[k + 1],
                                                                    k + 2 == widths.size());
        }
        return sum;
    }

    alignas(64) std::array<T, size()> parameters_;
};

/// Network with max(0, x) after the hidden layers: `StaticMlp<float, 4, 16, 16, 1>`.
template <class T, std::size_t... Widths>
using StaticMlp = BasicStaticMlp<Activation::relu, T, Widths...>;

/// Network with tanh(x) after the hidden layers.
template <class T, std::size_t... Widths>
using StaticTanhMlp = BasicStaticMlp<Activation::tanh, T, Widths...>;

}  // namespace ricochet
