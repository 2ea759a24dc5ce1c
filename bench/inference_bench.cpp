// What one evaluation of a small network costs.
//
//     infer/<hidden layers>/<type>/<activation>/<kernel>
//
// 4 inputs, 1 output. Every input depends on the output before it, as in an
// integration loop that acts on each prediction; storing the 4 inputs is included.
// Kernels: `static`, a shape fixed at compile time and compiled with the flags of this
// file (x86-64-v3 where the compiler has it); `common`, as `Mlp` chooses for these
// shapes; `general`, its kernel for any shape. The last two run on the instruction set
// that RICOCHET_BENCH_SET names, "x86-64-v3" unless set.
//
// `peak/fma` is the yardstick: 12 independent chains of 256-bit multiply-adds, in
// GFLOP/s of float. Figures of another machine, or of a noisy hour, are compared after
// scaling with it.
//
// Each case first checks that its network returns the bits of the baseline kernel. Of
// repetitions under other load the minimum is the least disturbed:
//
//     inference_bench --benchmark_repetitions=25 --benchmark_enable_random_interleaving=true
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/static_mlp.hpp"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace ricochet;

double smallest(const std::vector<double>& values)
{
    return *std::min_element(values.begin(), values.end());
}

/// Uniform weights of variance 1 / inputs.
Model network(const std::vector<std::size_t>& widths, Activation activation)
{
    std::mt19937_64 bits(1);
    const auto uniform = [&] { return static_cast<double>(bits() >> 11) * 0x1p-52 - 1; };
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

InstructionSet chosen_set()
{
    const char* wanted = std::getenv("RICOCHET_BENCH_SET");
    for (const InstructionSet set :
         {InstructionSet::baseline, InstructionSet::x86_64_v3, InstructionSet::x86_64_v4}) {
        if (name(set) == std::string_view(wanted != nullptr ? wanted : "x86-64-v3") &&
            supported(set)) {
            return set;
        }
    }
    return InstructionSet::baseline;
}

template <class T, class Network>
void evaluate(benchmark::State& state, const Network& network, const Mlp<T>& reference)
{
    T x[4]{T(0.1), T(-0.2), T(0.3), T(0.7)};
    T y = 0;
    T expected = 0;
    network.forward(x, &y);
    reference.forward(x, &expected);
    if (std::memcmp(&y, &expected, sizeof(T)) != 0) {
        state.SkipWithError("other bits than the baseline kernel");
        return;
    }
    for (auto _ : state) {
        network.forward(x, &y);
        for (int i = 0; i < 4; ++i) x[i] = y * T(1e-3) * T(i + 1);
        benchmark::DoNotOptimize(x);
    }
}

template <class T, Activation activation, std::size_t... Widths>
void register_shape(const std::string& hidden)
{
    const std::string prefix = "infer/" + hidden + (sizeof(T) == 4 ? "/float" : "/double") +
                               (activation == Activation::relu ? "/relu/" : "/tanh/");
    const Model model = network({4, Widths..., 1}, activation);
    const Mlp<T> reference(model, {InstructionSet::baseline, false});
    const BasicStaticMlp<activation, T, 4, Widths..., 1> fixed(model);
    const auto add = [&](const std::string& kernel, const auto& evaluated) {
        benchmark::RegisterBenchmark((prefix + kernel).c_str(), [=](benchmark::State& state) {
            evaluate(state, evaluated, reference);
        })->ComputeStatistics("min", smallest);
    };
    add("static", fixed);
    add("common", Mlp<T>(model, {chosen_set(), true}));
    add("general", Mlp<T>(model, {chosen_set(), false}));
}

template <class T, Activation activation>
void register_shapes()
{
    register_shape<T, activation, 8>("1x8");
    register_shape<T, activation, 16, 16>("2x16");
    register_shape<T, activation, 16, 16, 16, 16, 16>("5x16");
    register_shape<T, activation, 64, 64>("2x64");
}

#if defined(__FMA__)
typedef float Lanes __attribute__((vector_size(32)));

void fma_peak(benchmark::State& state)
{
    // The assembler is told the operation, so that 12 registers are 12 registers.
    Lanes a0{}, a1{}, a2{}, a3{}, a4{}, a5{}, a6{}, a7{}, a8{}, a9{}, a10{}, a11{};
    const Lanes b = 0.5F - Lanes{};
    constexpr int rounds = 100;
    for (auto _ : state) {
        for (int i = 0; i < rounds; ++i) {
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
    const double operations = 12 * 8 * 2 * rounds;
    state.counters["GFLOP/s"] =
        benchmark::Counter(operations * 1e-9, benchmark::Counter::kIsIterationInvariantRate);
}
#endif

}  // namespace

int main(int argc, char** argv)
{
#if defined(__FMA__)
    benchmark::RegisterBenchmark("peak/fma", fma_peak)->ComputeStatistics("min", smallest);
#endif
    register_shapes<float, Activation::relu>();
    register_shapes<double, Activation::relu>();
    register_shapes<float, Activation::tanh>();
    register_shapes<double, Activation::tanh>();
    benchmark::AddCustomContext("instruction_set", std::string(name(chosen_set())));
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
    benchmark::RunSpecifiedBenchmarks();
    benchmark::Shutdown();
    return 0;
}
