// Cost of one evaluation of a small network.
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
#include "networks.hpp"
#include "ricochet/nn/mlp.hpp"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace ricochet;

double smallest(const std::vector<double>& values)
{
    return *std::min_element(values.begin(), values.end());
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
    const Model model = bench::random_network({4, Widths..., 1}, activation);
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
    register_shape<T, activation, 16>("1x16");
    register_shape<T, activation, 16, 16>("2x16");
    register_shape<T, activation, 16, 16, 16, 16, 16>("5x16");
    register_shape<T, activation, 64, 64>("2x64");
}

#if defined(__FMA__)
void fma_peak(benchmark::State& state)
{
    constexpr std::size_t rounds = 100;
    for (auto _ : state) bench::multiply_add_rounds(rounds);
    const double operations = bench::operations_per_round * rounds;
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
