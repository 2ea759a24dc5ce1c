#include "ricochet/nn/guard_network.hpp"

#include "base/require.hpp"
#include "guard_kernel_table.hpp"
#include "ricochet/nn/mlp.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

namespace ricochet {
namespace detail {
namespace {

constexpr std::size_t guard_block = 4;  ///< values, 32 bytes

/// Doubles at an address that is a multiple of 64.
class AlignedDoubles {
public:
    explicit AlignedDoubles(std::size_t size) : all_(size + 8, 0.0) {}
    [[nodiscard]] double* data() noexcept
    {
        const auto address = reinterpret_cast<std::uintptr_t>(all_.data());
        return all_.data() + (64 - address % 64) % 64 / sizeof(double);
    }

private:
    std::vector<double> all_;
};

[[nodiscard]] std::size_t padded_row(std::size_t outputs) noexcept
{
    return (outputs + guard_block - 1) / guard_block * guard_block;
}

[[nodiscard]] std::size_t size_of(const Model& model) noexcept
{
    std::size_t size = 0;
    for (const DenseLayer& layer : model.layers) {
        size += padded_row(layer.outputs) * (1 + padded_row(layer.inputs) + 2);
    }
    return size + 4 * guard_block;
}

[[nodiscard]] const GuardKernels& kernels_of(Activation activation)
{
    using Kernels = std::array<GuardKernels, 5>;
    static const Kernels all = [] {
        const InstructionSet set = best_instruction_set();
        const ChooseGuardKernels choose = set == InstructionSet::x86_64_v4 ? guard_kernels_v4
                                          : set == InstructionSet::x86_64_v3
                                              ? guard_kernels_v3
                                              : guard_kernels_baseline;
        Kernels kernels;
        for (std::size_t k = 0; k < kernels.size(); ++k) {
            kernels[k] = choose(static_cast<Activation>(k));
        }
        return kernels;
    }();
    return all[static_cast<std::size_t>(activation)];
}

/// The parameters of one guard.
struct GuardMemory {
    explicit GuardMemory(const Model& model) : numbers(size_of(model))
    {
        const std::size_t inputs = model.layers.front().inputs;
        offset = model.offset.empty() ? std::vector<double>(inputs, 0.0) : model.offset;
        scale = model.scale.empty() ? std::vector<double>(inputs, 1.0) : model.scale;
        double* to = numbers.data();
        for (std::size_t k = 0; k < model.layers.size(); ++k) {
            layers.push_back(k + 1 < model.layers.size() ? pack(model.layers[k], to)
                                                         : pack_last(model.layers[k], to));
            layers.back().is_residual =
                std::find(model.residual.begin(), model.residual.end(), k) != model.residual.end();
        }
    }
    GuardMemory(const GuardMemory&) = delete;
    GuardMemory& operator=(const GuardMemory&) = delete;

    [[nodiscard]] static GuardLayer pack(const DenseLayer& from, double*& to)
    {
        return pack(from, to, padded_row(from.outputs));
    }
    /// One row of weights, ending with zeros, that begins a block, with the bias before it.
    [[nodiscard]] static GuardLayer pack_last(const DenseLayer& from, double*& to)
    {
        to += guard_block - 1;
        return pack(from, to, 1);
    }

private:
    [[nodiscard]] static GuardLayer pack(const DenseLayer& from, double*& to, std::size_t row)
    {
        GuardLayer layer{
            .inputs = from.inputs, .outputs = from.outputs, .row = row, .parameters = to};
        double* const rounding = to + row + row * padded_row(from.inputs);
        layer.rounding = rounding;
        // A sum of n products and a bias is off by at most (n + 2) u times the sizes of its terms:
        // in the range, and in the guard itself.
        const double ulps = 2 * static_cast<double>(from.inputs + 4) * 0x1p-53;
        for (std::size_t j = 0; j < from.outputs; ++j) {
            to[j] = from.bias[j];
            double sum = 0;
            for (std::size_t i = 0; i < from.inputs; ++i) {
                const double weight = from.weight[j * from.inputs + i];
                to[(i + 1) * row + j] = weight;
                sum += std::fabs(weight);
            }
            rounding[j] = ulps * sum;
            rounding[row + j] = ulps * std::fabs(from.bias[j]);
        }
        to = rounding + 2 * row;
        return layer;
    }

public:
    AlignedDoubles numbers;
    std::vector<double> offset, scale;
    std::vector<GuardLayer> layers;
};

void check_shapes(const Model& model, const Refuse& refuse)
{
    const auto number = [](std::size_t value) { return std::to_string(value); };
    const std::size_t count = model.layers.size();
    detail::check_layers(model, refuse.who,
                         {.layers = GuardNetwork::max_layers, .width = GuardNetwork::max_width});
    if (model.layers.back().outputs != 1) {
        refuse("expected 1 output, found " + number(model.layers.back().outputs));
    }
    for (const std::size_t k : model.residual) {
        if (k + 1 >= count) {
            refuse("expected residual layers before the last of " + number(count) + ", found " +
                   number(k));
        }
        if (model.layers[k].inputs != model.layers[k].outputs) {
            refuse("residual layer " + number(k) + ": expected as many outputs as inputs, found " +
                   number(model.layers[k].outputs) + " and " + number(model.layers[k].inputs));
        }
    }
}

void check_numbers(const Model& model, const Refuse& refuse)
{
    const auto is_finite = [](double x) { return std::isfinite(x); };
    const auto all_finite = [&](const std::vector<double>& values) {
        return std::all_of(values.begin(), values.end(), is_finite);
    };
    for (std::size_t k = 0; k < model.layers.size(); ++k) {
        if (!all_finite(model.layers[k].weight) || !all_finite(model.layers[k].bias)) {
            refuse("layer " + std::to_string(k) +
                   ": expected finite weights and biases, found one that is not");
        }
    }
    const std::size_t inputs = model.layers.front().inputs;
    for (const auto* const values : {&model.offset, &model.scale}) {
        if (!values->empty() && values->size() != inputs) {
            refuse("expected an offset and a scale for each of " + std::to_string(inputs) +
                   " inputs, found " + std::to_string(values->size()));
        }
        if (!all_finite(*values)) refuse("expected finite offsets and scales");
    }
}

}  // namespace
}  // namespace detail

std::string_view name(Activation activation) noexcept
{
    switch (activation) {
        case Activation::relu: return "relu";
        case Activation::tanh: return "tanh";
        case Activation::softplus: return "softplus";
        case Activation::silu: return "silu";
        case Activation::sine: return "sin";
    }
    return "";
}

GuardNetwork::GuardNetwork(const Model& model) : activation_(model.activation)
{
    constexpr detail::Refuse refuse{"GuardNetwork"};
    detail::check_shapes(model, refuse);
    detail::check_numbers(model, refuse);
    memory_ = detail::Shared<void>::make<detail::GuardMemory>(model);
    const auto& memory = *static_cast<const detail::GuardMemory*>(memory_.get());
    inputs_ = model.layers.front().inputs;
    layers_ = {.layers = memory.layers.data(),
               .count = memory.layers.size(),
               .offset = memory.offset.data(),
               .scale = memory.scale.data()};
    kernels_ = &detail::kernels_of(activation_);
}

double GuardNetwork::value(const double* x) const noexcept
{
    return kernels_->value(layers_, x);
}

double GuardNetwork::value_and_rate(const double* x, const double* dx, double& rate) const noexcept
{
    return kernels_->value_and_rate(layers_, x, dx, &rate);
}

double GuardNetwork::value_and_gradient(const double* x, double* gradient) const noexcept
{
    return kernels_->value_and_gradient(layers_, x, gradient);
}

detail::GuardRange GuardNetwork::range(const double* centre, const double* slope,
                                       const double* radius) const noexcept
{
    return kernels_->along(layers_, centre, slope, radius);
}

void GuardNetwork::throw_wrong_inputs(std::size_t given) const
{
    throw std::invalid_argument("GuardNetwork: expected " + std::to_string(inputs_) +
                                " inputs, found " + std::to_string(given));
}

}  // namespace ricochet
