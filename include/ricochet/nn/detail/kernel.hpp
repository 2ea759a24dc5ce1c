// Internal: the declarations of this header may change without notice.
//
// The arithmetic of a small multilayer perceptron, written once.
//
// Whatever the shape, the compiler and the instruction set, an evaluation does the
// same operations in the same order, so its result has the same bits everywhere:
//
//     hidden    y_j = activation((a_0 + a_1) + (a_2 + a_3)),
//               a_c the sum of w_ji x_i over i = c, c + C, c + 2 C, ..., after b_j
//               in a_0; there are C = `chains` of the number of outputs
//     last      the same without activation; but if it has one output, lane l of
//               chain c sums w_i x_i over every C-th block of 32 bytes, C = 4, 2 or 1
//               for as many blocks; chains are added as above, lanes in halves, b last
//
// Products are rounded before they are added: `opaque` hides each from the
// compiler, which would otherwise contract the two to one operation on some
// machines (g++ does by default). A register holds 16 or 32 bytes, depending on the
// target; the result depends neither on the lane in which an output is computed nor on
// the number that are computed together.
#pragma once

#include "ricochet/nn/detail/activation.hpp"
#include "ricochet/nn/detail/simd.hpp"

#include <cstddef>
#include <cstdint>

namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE {

/// The widest layer that fits in the buffers on the stack.
inline constexpr std::size_t max_width = 256;

/// `width` rounded up to whole blocks.
template <class T>
[[nodiscard]] constexpr std::size_t padded(std::size_t width) noexcept
{
    return (width + block<T> - 1) / block<T> * block<T>;
}

/// Partial sums per output: with few outputs there are too few independent additions to
/// hide the latency of one.
template <class T>
[[nodiscard]] constexpr std::size_t chains(std::size_t outputs) noexcept
{
    const std::size_t blocks = padded<T>(outputs) / block<T>;
    return blocks <= 2 ? 4 : blocks <= 4 ? 2 : 1;
}

/// Values stored for one layer: a padded row of biases, then for each input a
/// padded row of weights. If the last layer has one output, its weights are one
/// padded row, and the bias begins a block of its own after them.
template <class T>
[[nodiscard]] constexpr std::size_t layer_size(std::size_t inputs, std::size_t outputs,
                                               bool last) noexcept
{
    return last && outputs == 1 ? padded<T>(inputs) + block<T> : padded<T>(outputs) * (1 + inputs);
}

/// Registers used for sums: half of the registers of any of our instruction sets; the rest
/// are for weights and inputs.
inline constexpr std::size_t accumulators = 8;

/// Sums of `Chains` partial sums in pairs.
template <std::size_t Chains, class V>
RICOCHET_INLINE V sum_of(const V (&a)[Chains]) noexcept
{
    if constexpr (Chains == 4) {
        return (a[0] + a[1]) + (a[2] + a[3]);
    } else if constexpr (Chains == 2) {
        return a[0] + a[1];
    } else {
        static_assert(Chains == 1);
        return a[0];
    }
}

/// `Registers` registers of outputs of one layer. `parameters` and `y` begin at
/// the first of them; `row` is the distance between rows of weights.
template <class T, class Activation, std::size_t Registers, std::size_t Chains>
RICOCHET_INLINE void outputs_together(const T* parameters, std::size_t row, const T* x,
                                      std::size_t inputs, T* y) noexcept
{
    using V = Vector<T>;
    V sums[Registers][Chains];
    const T* weights = parameters + row;
    const auto product = [&](std::size_t k, std::size_t i) RICOCHET_INLINE_LAMBDA {
        return load(weights + i * row + k * lanes<T>) * x[i];
    };
    RICOCHET_UNROLL
    for (std::size_t c = 0; c < Chains; ++c) {
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < Registers; ++k) {
            sums[k][c] = c == 0 ? load(parameters + k * lanes<T>) : V{};
            if (c >= inputs) continue;
            if (c == 0) {
                accumulate(sums[k][c], product(k, c));
            } else {
                sums[k][c] = opaque(product(k, c));
            }
        }
    }
    std::size_t i = Chains;
    RICOCHET_KEEP_LOOP
    for (; i + Chains <= inputs; i += Chains) {
        RICOCHET_UNROLL
        for (std::size_t c = 0; c < Chains; ++c) {
            RICOCHET_UNROLL
            for (std::size_t k = 0; k < Registers; ++k) accumulate(sums[k][c], product(k, i + c));
        }
    }
    RICOCHET_UNROLL
    for (std::size_t c = 0; c + 1 < Chains; ++c) {
        if (i + c >= inputs) continue;
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < Registers; ++k) accumulate(sums[k][c], product(k, i + c));
    }
    RICOCHET_UNROLL
    for (std::size_t k = 0; k < Registers; ++k) {
        store(y + k * lanes<T>, Activation::template of<T>(sum_of<Chains>(sums[k])));
    }
}

/// Parameters of a layer: its biases, then a row of weights for each input.
template <class T>
struct LayerParameters {
    const T* parameters;
    std::size_t inputs;
    std::size_t row;  ///< outputs, padded
};

/// Outputs `first` ... `row` - 1, as many together as fit in the registers.
template <class T, class Activation, std::size_t Registers, std::size_t Chains>
RICOCHET_INLINE void outputs_from(std::size_t first, const LayerParameters<T>& layer, const T* x,
                                  T* y) noexcept
{
    constexpr std::size_t step = Registers * lanes<T>;
    for (; first + step <= layer.row; first += step) {
        outputs_together<T, Activation, Registers, Chains>(layer.parameters + first, layer.row, x,
                                                           layer.inputs, y + first);
    }
    if constexpr (Registers > 1) {
        outputs_from<T, Activation, Registers / 2, Chains>(first, layer, x, y);
    }
}

/// y = activation(W x + b), all padded outputs; the padding of y is activation(0)
/// for finite x.
template <class T, class Activation>
RICOCHET_INLINE void dense(const T* parameters, const T* x, std::size_t inputs, std::size_t outputs,
                           T* y) noexcept
{
    const LayerParameters<T> layer{parameters, inputs, padded<T>(outputs)};
    switch (chains<T>(outputs)) {
        case 4: outputs_from<T, Activation, accumulators / 4, 4>(0, layer, x, y); break;
        case 2: outputs_from<T, Activation, accumulators / 2, 2>(0, layer, x, y); break;
        default: outputs_from<T, Activation, accumulators, 1>(0, layer, x, y); break;
    }
}

/// Outputs `First` ... `Row` - 1 where both are known: only the numbers of registers that occur are
/// compiled.
template <class T, class Activation, std::size_t Registers, std::size_t Chains, std::size_t First,
          std::size_t Row>
RICOCHET_INLINE void known_outputs(const T* parameters, const T* x, std::size_t inputs,
                                   T* y) noexcept
{
    constexpr std::size_t step = Registers * lanes<T>;
    constexpr std::size_t end = First + (Row - First) / step * step;
    for (std::size_t first = First; first < end; first += step) {
        outputs_together<T, Activation, Registers, Chains>(parameters + first, Row, x, inputs,
                                                           y + first);
    }
    if constexpr (end < Row) {
        known_outputs<T, Activation, Registers / 2, Chains, end, Row>(parameters, x, inputs, y);
    }
}

/// Same as `dense`.
template <class T, class Activation, std::size_t Outputs>
RICOCHET_INLINE void known_dense(const T* parameters, const T* x, std::size_t inputs, T* y) noexcept
{
    constexpr std::size_t together = chains<T>(Outputs);
    known_outputs<T, Activation, accumulators / together, together, 0, padded<T>(Outputs)>(
        parameters, x, inputs, y);
}

/// Zeroes the padding of y: with infinite inputs a layer leaves NaN there.
template <class T>
RICOCHET_INLINE void clear_padding(T* y, std::size_t outputs) noexcept
{
    for (std::size_t j = outputs; j < padded<T>(outputs); ++j) y[j] = 0;
}

/// w x + b for one output, with x padded by zeros; `Chains` blocks at a time.
template <class T, std::size_t Chains>
RICOCHET_INLINE T dot_by(const T* parameters, const T* x, std::size_t inputs) noexcept
{
    using V = Vector<T>;
    constexpr std::size_t parts = block<T> / lanes<T>;
    V sums[parts][Chains];
    const auto product = [&](std::size_t k, std::size_t i) RICOCHET_INLINE_LAMBDA {
        return load(parameters + i + k * lanes<T>) * load(x + i + k * lanes<T>);
    };
    RICOCHET_UNROLL
    for (std::size_t k = 0; k < parts; ++k) {
        RICOCHET_UNROLL
        for (std::size_t c = 0; c < Chains; ++c) sums[k][c] = opaque(product(k, c * block<T>));
    }
    const std::size_t end = padded<T>(inputs);
    std::size_t i = Chains * block<T>;
    for (; i + Chains * block<T> <= end; i += Chains * block<T>) {
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < parts; ++k) {
            RICOCHET_UNROLL
            for (std::size_t c = 0; c < Chains; ++c) {
                accumulate(sums[k][c], product(k, i + c * block<T>));
            }
        }
    }
    RICOCHET_UNROLL
    for (std::size_t c = 0; c + 1 < Chains; ++c) {
        if (i + c * block<T> >= end) continue;
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < parts; ++k) {
            accumulate(sums[k][c], product(k, i + c * block<T>));
        }
    }
    V total[parts];
    RICOCHET_UNROLL
    for (std::size_t k = 0; k < parts; ++k) total[k] = sum_of<Chains>(sums[k]);
    return sum_of_lanes<T>(total) + parameters[end];
}

template <class T>
RICOCHET_INLINE T dot(const T* parameters, const T* x, std::size_t inputs) noexcept
{
    const std::size_t blocks = padded<T>(inputs) / block<T>;
    if (blocks >= 4) return dot_by<T, 4>(parameters, x, inputs);
    if (blocks >= 2) return dot_by<T, 2>(parameters, x, inputs);
    return dot_by<T, 1>(parameters, x, inputs);
}

/// The last layer: no activation, and exactly `outputs` values instead of whole blocks.
template <class T>
RICOCHET_INLINE void last(const T* parameters, const T* x, std::size_t inputs, std::size_t outputs,
                          T* y) noexcept
{
    if (outputs == 1) {
        *y = dot(parameters, x, inputs);
        return;
    }
    alignas(block_bytes) T all[max_width];
    dense<T, Linear>(parameters, x, inputs, outputs, all);
    for (std::size_t j = 0; j < outputs; ++j) y[j] = all[j];
}

/// The layers after `x`, whose widths are known: `Width` outputs, then `Widths`.
template <class T, class Activation, std::size_t Width, std::size_t... Widths>
RICOCHET_INLINE void layers(const T* parameters, const T* x, std::size_t inputs, T* y) noexcept
{
    if constexpr (sizeof...(Widths) == 0 && Width == 1) {
        *y = dot(parameters, x, inputs);
    } else if constexpr (sizeof...(Widths) == 0) {
        last(parameters, x, inputs, Width, y);
    } else {
        alignas(block_bytes) T hidden[padded<T>(Width)];
        known_dense<T, Activation, Width>(parameters, x, inputs, hidden);
        clear_padding(hidden, Width);
        layers<T, Activation, Widths...>(parameters + layer_size<T>(inputs, Width, false), hidden,
                                         Width, y);
    }
}

/// A network of which only the input is read in place; a single layer with one output
/// needs the input padded.
template <class T, class Activation, std::size_t... Widths>
RICOCHET_INLINE void network(const T* parameters, const T* in, std::size_t inputs, T* out) noexcept
{
    if constexpr (sizeof...(Widths) == 1) {
        alignas(block_bytes) T x[max_width];
        for (std::size_t i = 0; i < inputs; ++i) x[i] = in[i];
        clear_padding(x, inputs);
        layers<T, Activation, Widths...>(parameters, x, inputs, out);
    } else {
        layers<T, Activation, Widths...>(parameters, in, inputs, out);
    }
}

/// The same for widths that are known only at run time: `widths` has `layers + 1` of them.
template <class T, class Activation>
RICOCHET_INLINE void network(const T* parameters, const std::uint16_t* widths, std::size_t layers,
                             const T* in, T* out) noexcept
{
    alignas(block_bytes) T hidden[2][max_width];
    const T* x = in;
    if (layers == 1) {
        T* padded_input = hidden[0];
        for (std::size_t i = 0; i < widths[0]; ++i) padded_input[i] = in[i];
        clear_padding(padded_input, widths[0]);
        x = padded_input;
    }
    for (std::size_t k = 0; k + 1 < layers; ++k) {
        T* y = hidden[k % 2];
        dense<T, Activation>(parameters, x, widths[k], widths[k + 1], y);
        clear_padding(y, widths[k + 1]);
        parameters += layer_size<T>(widths[k], widths[k + 1], false);
        x = y;
    }
    last(parameters, x, widths[layers - 1], widths[layers], out);
}

template <bool>
struct HiddenActivation {
    using Type = Relu;
};

template <>
struct HiddenActivation<false> {
    using Type = Tanh;
};

/// A whole network whose shape is known: `Widths` are those after the input.
template <class T, bool relu, std::size_t Inputs, std::size_t... Widths>
inline void evaluate(const T* parameters, const T* in, T* out) noexcept
{
    network<T, typename HiddenActivation<relu>::Type, Widths...>(parameters, in, Inputs, out);
}

}  // namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE
