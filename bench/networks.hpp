// Networks with random weights, and the yardstick of their evaluation.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "ricochet/nn/model.hpp"

namespace ricochet::bench {

/// A network with these widths, the inputs first: uniform weights of variance
/// 1 / inputs, uniform biases in [-1, 1).
[[nodiscard]] inline Model random_network(const std::vector<std::size_t>& widths,
                                          Activation activation, std::uint64_t seed = 1)
{
    std::mt19937_64 bits(seed);
    const auto uniform = [&] { return static_cast<double>(bits() >> 11U) * 0x1p-52 - 1; };
    Model model;
    model.activation = activation;
    for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
        DenseLayer layer{widths[k], widths[k + 1], {}, {}};
        const double scale = std::sqrt(3 / static_cast<double>(layer.inputs));
        for (std::size_t i = 0; i < layer.inputs * layer.outputs; ++i) {
            layer.weight.push_back(scale * uniform());
        }
        for (std::size_t j = 0; j < layer.outputs; ++j) layer.bias.push_back(uniform());
        model.layers.push_back(layer);
    }
    return model;
}

/// Operations on float, a multiplication and an addition in each of 8 lanes, of one
/// round of `multiply_add_rounds`.
inline constexpr double operations_per_round = 12 * 8 * 2;

#if defined(__FMA__)
/// `rounds` times 12 independent chains of 256-bit multiply-adds: the peak performance of a core of
/// x86-64-v3.
[[gnu::always_inline]] inline void multiply_add_rounds(std::size_t rounds)
{
    typedef float Lanes __attribute__((vector_size(32)));
    // The operation is written in assembler, so that the 12 sums stay in 12 registers.
    Lanes a0{}, a1{}, a2{}, a3{}, a4{}, a5{}, a6{}, a7{}, a8{}, a9{}, a10{}, a11{};
    const Lanes b = 0.5F - Lanes{};
    for (std::size_t i = 0; i < rounds; ++i) {
        asm volatile(
            "vfmadd231ps %12, %12, %0\n\t"
            "vfmadd231ps %12, %12, %1\n\t"
            "vfmadd231ps %12, %12, %2\n\t"
            "vfmadd231ps %12, %12, %3\n\t"
            "vfmadd231ps %12, %12, %4\n\t"
            "vfmadd231ps %12, %12, %5\n\t"
            "vfmadd231ps %12, %12, %6\n\t"
            "vfmadd231ps %12, %12, %7\n\t"
            "vfmadd231ps %12, %12, %8\n\t"
            "vfmadd231ps %12, %12, %9\n\t"
            "vfmadd231ps %12, %12, %10\n\t"
            "vfmadd231ps %12, %12, %11"
            : "+x"(a0), "+x"(a1), "+x"(a2), "+x"(a3), "+x"(a4), "+x"(a5), "+x"(a6), "+x"(a7),
              "+x"(a8), "+x"(a9), "+x"(a10), "+x"(a11)
            : "x"(b));
    }
}
#endif

}  // namespace ricochet::bench
