// Networks of fixed shape, evaluated by code compiled for x86-64-v3.
//
// A network is built by a caller compiled for any machine: its parameters do not
// depend on the instruction set. Only the evaluation does.
#pragma once

#include <cstddef>

#include "ricochet/nn/mlp.hpp"

namespace ricochet::bench {

/// A shape that is measured: 4 inputs, the hidden layers, 1 output. Instances are
/// those at the end of static_networks.cpp.
template <Activation activation, class T, std::size_t... Hidden>
struct StaticNetwork {
    using Mlp = BasicStaticMlp<activation, T, 4, Hidden..., 1>;

    /// Evaluates `samples` rows of 4 inputs one after the other.
    static void each(const Mlp& mlp, const T* in, std::size_t samples, T* out);

    /// Evaluates n times; every input depends on the output before it, as in an
    /// integration loop that acts on each prediction.
    static void chain(const Mlp& mlp, T* x, std::size_t n);
};

/// The 4 inputs that follow an output.
template <class T>
[[gnu::always_inline]] inline void next_inputs(T y, T* x)
{
    for (int i = 0; i < 4; ++i) x[i] = y * T(1e-3) * T(i + 1);
}

/// `multiply_add_rounds` of networks.hpp; nothing where the compiler has no such
/// instruction.
void run_multiply_adds(std::size_t rounds);

/// Whether all this is compiled for x86-64-v3, and not for the baseline.
[[nodiscard]] bool static_networks_are_v3() noexcept;

}  // namespace ricochet::bench
