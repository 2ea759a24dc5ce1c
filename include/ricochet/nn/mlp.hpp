// Evaluation of a multilayer perceptron whose shape is known at run time.
//
// The kernels are compiled into the library for several instruction sets; the best
// one that the processor has is chosen once, at start. Common shapes have
// instances of their own. None of this shows in the result: for the same
// parameters and input every instruction set and every instance, and `StaticMlp`,
// return the same bits.
#pragma once

#include "ricochet/nn/model.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

namespace ricochet {

/// Instruction set that a kernel is compiled for. Processors other than x86-64 have the baseline
/// only.
enum class InstructionSet {
    baseline,   ///< whatever the library is compiled for, e.g. SSE2
    x86_64_v3,  ///< AVX2
    x86_64_v4,  ///< AVX-512
};

/// Name of an instruction set as gcc spells it: "baseline", "x86-64-v3" or "x86-64-v4".
[[nodiscard]] std::string_view name(InstructionSet set) noexcept;

/// Whether this build has kernels for `set` and this processor runs them.
[[nodiscard]] bool supported(InstructionSet set) noexcept;

/// The fastest that is supported.
[[nodiscard]] InstructionSet best_instruction_set() noexcept;

namespace detail {

/// Input of a kernel; the pointers are into memory that an `Mlp` owns.
template <class T>
struct Network {
    const T* parameters = nullptr;          ///< as `pack` stores them, aligned to 64 bytes
    const std::uint16_t* widths = nullptr;  ///< layers + 1
    std::size_t layers = 0;
};

/// Evaluates `samples` rows of inputs one after the other.
template <class T>
using Kernel = void (*)(const Network<T>&, const T* in, T* out, std::size_t samples) noexcept;

}  // namespace detail

/// Options of the inference.
struct MlpOptions {
    InstructionSet instruction_set = best_instruction_set();
    bool common_shapes = true;  ///< use an instance of its own for a common shape
};

/// A network in the arithmetic of T, float or double.
///
///     x_0 = in,  x_k+1 = activation(W_k x_k + b_k),  out = W_n x_n + b_n
///
/// Immutable, so threads may share it; copies share the parameters. Evaluation
/// allocates nothing, keeps its activations on the stack, and carries NaN and
/// infinity through as the formula does. Offset, scale and threshold of the model
/// are not applied: see `Classifier`.
template <class T>
class Mlp {
public:
    static constexpr std::size_t max_width = 256;  ///< of a layer, and of the input
    static constexpr std::size_t max_layers = 64;

    /// @throws std::invalid_argument if the layers do not fit together, or are wider
    /// or more than the limits, or if the instruction set is not supported.
    explicit Mlp(const Model& model, const MlpOptions& options = {});

    /// Reads `inputs()` values and writes `outputs()`.
    void forward(const T* in, T* out) const noexcept { kernel_(network_, in, out, 1); }

    /// Reads `samples` rows of `inputs()` values each, and writes as many rows of
    /// `outputs()`: the same bits as one by one.
    void forward_batch(const T* in, std::size_t samples, T* out) const noexcept
    {
        kernel_(network_, in, out, samples);
    }

    [[nodiscard]] std::size_t inputs() const noexcept { return network_.widths[0]; }
    [[nodiscard]] std::size_t outputs() const noexcept { return network_.widths[network_.layers]; }

private:
    detail::Network<T> network_;
    detail::Kernel<T> kernel_;
    std::shared_ptr<const void> memory_;
};

extern template class Mlp<float>;
extern template class Mlp<double>;

}  // namespace ricochet
