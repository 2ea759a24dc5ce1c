// Cost of an evaluation of a small network, and the equality of the bits that
// all kernels return.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "networks.hpp"
#include "ricochet/nn/mlp.hpp"
#include "static_networks.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

/// Whether code for x86-64-v3 is in this build and can run here.
bool has_v3()
{
    return static_networks_are_v3() && supported(InstructionSet::x86_64_v3);
}

// --- time ---

/// One kernel on one shape. The reference is the median of hand-written kernels, ReLU,
/// dependent calls, on the machine whose multiply-adds peak at `peak_reference`: one
/// core of an AMD EPYC (Zen 4) guest, g++ 12.2.
struct TimedKernel {
    std::string shape;
    std::string_view type;
    std::string_view kernel;
    double reference;  ///< [ns]
    Work work;
    bool right;  ///< it returns the bits of the baseline kernel
};

constexpr double peak_reference = 118;  ///< [GFLOP/s] of float

/// [ns] of the reference.
struct Reference {
    double fixed;     ///< shape known at compile time
    double run_time;  ///< shape known at run time
};

template <class T, std::size_t... Hidden>
void add_kernels(const std::string& shape, const Reference& reference,
                 std::vector<TimedKernel>& kernels)
{
    using Static = StaticNetwork<Activation::relu, T, Hidden...>;
    const Model model = random_network({4, Hidden..., 1}, Activation::relu);
    const Mlp<T> baseline(model, {InstructionSet::baseline, false});
    const typename Static::Mlp fixed(model);
    const Mlp<T> run_time(model, {InstructionSet::x86_64_v3, true});

    const std::array<T, 4> start{T(0.1), T(-0.2), T(0.3), T(0.7)};
    T expected = 0;
    T by_fixed = 0;
    T by_run_time = 0;
    baseline.forward(start.data(), &expected);
    Static::each(fixed, start.data(), 1, &by_fixed);
    run_time.forward(start.data(), &by_run_time);
    const auto right = [&](T y) { return std::memcmp(&y, &expected, sizeof(T)) == 0; };

    const std::string_view type = sizeof(T) == 4 ? "float" : "double";
    kernels.push_back({.shape = shape,
                       .type = type,
                       .kernel = "static",
                       .reference = reference.fixed,
                       .work =
                           [=](std::size_t n) {
                               auto x = start;
                               Static::chain(fixed, x.data(), n);
                           },
                       .right = right(by_fixed)});
    kernels.push_back({.shape = shape,
                       .type = type,
                       .kernel = "run-time",
                       .reference = reference.run_time,
                       .work =
                           [=](std::size_t n) {
                               auto x = start;
                               T y = 0;
                               for (std::size_t i = 0; i < n; ++i) {
                                   run_time.forward(x.data(), &y);
                                   next_inputs(y, x.data());
                                   keep(x);
                               }
                           },
                       .right = right(by_run_time)});
}

// --- bits ---

struct Comparison {
    std::size_t outputs = 0;
    std::size_t mismatches = 0;
};

/// Inputs of magnitudes 1e-3 to 1e3.
template <class T>
std::vector<T> spread_inputs(std::size_t count)
{
    std::mt19937_64 bits(2);
    const auto uniform = [&] { return static_cast<double>(bits() >> 11U) * 0x1p-52 - 1; };
    std::vector<T> values(count);
    for (T& value : values) value = static_cast<T>(uniform() * std::pow(10, 3 * uniform()));
    return values;
}

template <class T>
void compare_bytes(const std::vector<T>& found, const std::vector<T>& expected, Comparison& result)
{
    for (std::size_t i = 0; i < expected.size(); ++i) {
        ++result.outputs;
        if (std::memcmp(&found[i], &expected[i], sizeof(T)) != 0) ++result.mismatches;
    }
}

template <Activation activation, class T, std::size_t... Hidden>
void compare_kernels(Comparison& result)
{
    using Static = StaticNetwork<activation, T, Hidden...>;
    constexpr std::size_t samples = 1000;
    const std::vector<T> in = spread_inputs<T>(4 * samples);
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
        const Model model = random_network({4, Hidden..., 1}, activation, seed);
        std::vector<T> expected(samples);
        std::vector<T> found(samples);
        Mlp<T>(model, {InstructionSet::baseline, false})
            .forward_batch(in.data(), samples, expected.data());
        for (const InstructionSet set :
             {InstructionSet::baseline, InstructionSet::x86_64_v3, InstructionSet::x86_64_v4}) {
            if (!supported(set)) continue;
            for (const bool common : {false, true}) {
                Mlp<T>(model, {set, common}).forward_batch(in.data(), samples, found.data());
                compare_bytes(found, expected, result);
            }
        }
        const typename Static::Mlp fixed(model);
        fixed.forward_batch(in.data(), samples, found.data());  // with the flags of this file
        compare_bytes(found, expected, result);
        if (has_v3()) {
            Static::each(fixed, in.data(), samples, found.data());
            compare_bytes(found, expected, result);
        }
    }
}

template <Activation activation, class T>
void compare_shapes(Comparison& result)
{
    compare_kernels<activation, T, 8>(result);
    compare_kernels<activation, T, 16>(result);
    compare_kernels<activation, T, 16, 16>(result);
    compare_kernels<activation, T, 16, 16, 16, 16, 16>(result);
    compare_kernels<activation, T, 64, 64>(result);
}

}  // namespace

Measured time_inference()
{
    if (!has_v3()) {
        return {.pass = false, .text = "not measured: x86-64-v3 is not there, FMA included"};
    }
    std::vector<TimedKernel> kernels;
    add_kernels<float, 8>("1x8", {13.8, 25.7}, kernels);
    add_kernels<float, 16, 16>("2x16", {26.5, 38}, kernels);
    add_kernels<float, 16, 16, 16, 16, 16>("5x16", {59, 81}, kernels);
    add_kernels<float, 64, 64>("2x64", {102, 107}, kernels);
    add_kernels<double, 8>("1x8", {14.3, 23}, kernels);
    add_kernels<double, 16, 16>("2x16", {37, 36}, kernels);
    add_kernels<double, 16, 16, 16, 16, 16>("5x16", {81, 79}, kernels);
    add_kernels<double, 64, 64>("2x64", {270, 323}, kernels);

    std::vector<Work> works{run_multiply_adds};
    for (const TimedKernel& k : kernels) works.push_back(k.work);
    const std::vector<Timing> timings = time_in_turns(works, {.budget = 0.15, .most = 701});
    const double peak = operations_per_round / timings[0].median * 1e-9;

    std::vector<std::string> details{
        fmt::format("multiply-adds: {:.0f} GFLOP/s [{:.0f} - {:.0f}], {:.0f} on the reference "
                    "machine; ns a call, medians [p10 - p90]",
                    peak, operations_per_round / timings[0].p90 * 1e-9,
                    operations_per_round / timings[0].p10 * 1e-9, peak_reference),
        fmt::format("{:<7}{:<8}{:<10}{:>8}{:>20}{:>9}{:>11}{:>7}", "hidden", "type", "shape is",
                    "raw", "spread", "scaled", "reference", "ratio")};
    bool right = true;
    double worst = 0;
    std::string at;
    for (std::size_t i = 0; i < kernels.size(); ++i) {
        const TimedKernel& k = kernels[i];
        const Timing& time = timings[i + 1];
        const double cost = time.median * 1e9 * peak / peak_reference;
        const double ratio = cost / k.reference;
        right = right && k.right;
        if (ratio > worst) {
            worst = ratio;
            at = fmt::format("{} {} {}", k.shape, k.type, k.kernel);
        }
        details.push_back(fmt::format(
            "{:<7}{:<8}{:<10}{:>8.1f}{:>20}{:>9.1f}{:>11.1f}{:>7.2f}{}", k.shape, k.type, k.kernel,
            time.median * 1e9, fmt::format("[{:.1f} - {:.1f}]", time.p10 * 1e9, time.p90 * 1e9),
            cost, k.reference, ratio, k.right ? "" : "  WRONG BITS"));
    }
    return {.pass = right && worst <= 1.3,
            .text = fmt::format("largest ratio {:.2f} ({}), of {}", worst, at, kernels.size()),
            .details = std::move(details)};
}

Measured compare_instruction_sets()
{
    Comparison result;
    compare_shapes<Activation::relu, float>(result);
    compare_shapes<Activation::relu, double>(result);
    compare_shapes<Activation::tanh, float>(result);
    compare_shapes<Activation::tanh, double>(result);
    std::string sets;
    std::string missing;
    for (const InstructionSet set :
         {InstructionSet::baseline, InstructionSet::x86_64_v3, InstructionSet::x86_64_v4}) {
        std::string& list = supported(set) ? sets : missing;
        list += fmt::format("{}{}", list.empty() ? "" : ", ", name(set));
    }
    return {.pass = result.mismatches == 0 && result.outputs > 0 && missing.empty(),
            .text = fmt::format("{} outputs, {} mismatches; {}, StaticMlp {}{}", result.outputs,
                                result.mismatches, sets,
                                has_v3() ? "compiled for baseline and x86-64-v3" : "for baseline",
                                missing.empty() ? "" : "; NOT HERE: " + missing)};
}

}  // namespace ricochet::bench
