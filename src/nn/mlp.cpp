#include "ricochet/nn/mlp.hpp"

#include "base/require.hpp"
#include "kernel_table.hpp"
#include "ricochet/nn/detail/pack.hpp"

#include <array>
#include <new>
#include <stdexcept>
#include <string>

namespace ricochet {
namespace {

using namespace detail::RICOCHET_KERNEL_NAMESPACE;

const detail::KernelTable& table(InstructionSet set) noexcept
{
    switch (set) {
        case InstructionSet::x86_64_v3: return detail::kernels_v3;
        case InstructionSet::x86_64_v4: return detail::kernels_v4;
        case InstructionSet::baseline: break;
    }
    return detail::kernels_baseline;
}

/// Whether the processor has an instruction set. Only the features that distinguish the levels are
/// tested; no processor has them without the rest of its level.
bool processor_has(InstructionSet set) noexcept
{
#if defined(__x86_64__)
    const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                    __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
    const bool v4 = v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                    __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
                    __builtin_cpu_supports("avx512vl");
    switch (set) {
        case InstructionSet::baseline: return true;
        case InstructionSet::x86_64_v3: return v3;
        case InstructionSet::x86_64_v4: return v4;
    }
    return false;
#else
    return set == InstructionSet::baseline;
#endif
}

/// The parameters and widths of one network.
template <class T>
struct Memory {
    explicit Memory(const Model& model)
        : parameters(static_cast<T*>(
              ::operator new (packed_size<T>(model) * sizeof(T), std::align_val_t{64})))
    {
        pack(model, parameters);
        widths[0] = static_cast<std::uint16_t>(model.layers.front().inputs);
        for (std::size_t k = 0; k < model.layers.size(); ++k) {
            widths[k + 1] = static_cast<std::uint16_t>(model.layers[k].outputs);
        }
    }
    ~Memory() { ::operator delete (parameters, std::align_val_t{64}); }
    Memory(const Memory&) = delete;
    Memory& operator=(const Memory&) = delete;

    T* parameters;
    std::array<std::uint16_t, Mlp<T>::max_layers + 1> widths{};
};

}  // namespace

std::string_view name(InstructionSet set) noexcept
{
    switch (set) {
        case InstructionSet::x86_64_v3: return "x86-64-v3";
        case InstructionSet::x86_64_v4: return "x86-64-v4";
        case InstructionSet::baseline: break;
    }
    return "baseline";
}

bool supported(InstructionSet set) noexcept
{
    return table(set).single != nullptr && processor_has(set);
}

InstructionSet best_instruction_set() noexcept
{
    static const InstructionSet best =
        supported(InstructionSet::x86_64_v4)   ? InstructionSet::x86_64_v4
        : supported(InstructionSet::x86_64_v3) ? InstructionSet::x86_64_v3
                                               : InstructionSet::baseline;
    return best;
}

void detail::check_layers(const Model& model, std::string_view who, const LayerLimits& limits)
{
    const Refuse refuse{who};
    const auto number = [](std::size_t value) { return std::to_string(value); };
    static_assert(Mlp<float>::max_width == LayerLimits{}.width &&
                  Mlp<float>::max_layers == LayerLimits{}.layers);
    if (model.layers.empty() || model.layers.size() > limits.layers) {
        refuse("expected 1 to " + number(limits.layers) + " layers, found " +
               number(model.layers.size()));
    }
    for (std::size_t k = 0; k < model.layers.size(); ++k) {
        const DenseLayer& layer = model.layers[k];
        const std::string here = "layer " + number(k);
        for (const std::size_t width : {layer.inputs, layer.outputs}) {
            if (width == 0 || width > limits.width) {
                refuse(here + ": expected a width from 1 to " + number(limits.width) + ", found " +
                       number(width));
            }
        }
        if (layer.weight.size() != layer.inputs * layer.outputs) {
            refuse(here + ": expected " + number(layer.outputs) + " x " + number(layer.inputs) +
                   " weights, found " + number(layer.weight.size()));
        }
        if (layer.bias.size() != layer.outputs) {
            refuse(here + ": expected " + number(layer.outputs) + " biases, found " +
                   number(layer.bias.size()));
        }
        if (k > 0 && layer.inputs != model.layers[k - 1].outputs) {
            refuse(here + ": expected " + number(model.layers[k - 1].outputs) +
                   " inputs, as many as the layer before has outputs, found " +
                   number(layer.inputs));
        }
    }
}

template <class T>
Mlp<T>::Mlp(const Model& model, const MlpOptions& options)
{
    detail::check_layers(model, "Mlp");
    if (model.activation != Activation::relu && model.activation != Activation::tanh) {
        throw std::invalid_argument("Mlp: expected the activation relu or tanh, found " +
                                    std::string(name(model.activation)) +
                                    "; a guard is a GuardNetwork");
    }
    if (!model.residual.empty()) {
        throw std::invalid_argument("Mlp: found residual layers; a guard is a GuardNetwork");
    }
    if (!supported(options.instruction_set)) {
        throw std::invalid_argument("Mlp: instruction set " +
                                    std::string(name(options.instruction_set)) +
                                    " is not supported here");
    }
    memory_ = detail::Shared<void>::make<Memory<T>>(model);
    const auto& memory = *static_cast<const Memory<T>*>(memory_.get());
    network_ = {memory.parameters, memory.widths.data(), model.layers.size()};

    const detail::KernelTable& kernels = table(options.instruction_set);
    const bool relu = model.activation == Activation::relu;
    if constexpr (sizeof(T) == sizeof(float)) {
        kernel_ = kernels.single(network_, relu, options.common_shapes);
    } else {
        kernel_ = kernels.double_(network_, relu, options.common_shapes);
    }
}

template class Mlp<float>;
template class Mlp<double>;

}  // namespace ricochet
