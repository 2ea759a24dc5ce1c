#include "ricochet/sensitivity/network.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/require.hpp"
#include "ricochet/nn/detail/activation.hpp"
#include "ricochet/nn/detail/pack.hpp"

namespace ricochet {

namespace {

namespace kernel = detail::RICOCHET_KERNEL_NAMESPACE;

constexpr std::size_t width = Mlp<double>::max_width;
constexpr std::size_t lanes = kernel::lanes<double>;

/// y += a x, in which no sum is reordered.
inline void add_multiple(double* __restrict y, double a, const double* __restrict x,
                         std::size_t n) noexcept
{
    for (std::size_t i = 0; i < n; ++i) y[i] += a * x[i];
}

/// tanh of each number, in place; behind them there is space up to whole registers.
inline void tanh_all(double* y, std::size_t n) noexcept
{
    for (std::size_t i = n; i % lanes != 0; ++i) y[i] = 0;
    for (std::size_t i = 0; i < n; i += lanes) {
        kernel::store(y + i, kernel::Tanh::of<double>(kernel::load(y + i)));
    }
}

}  // namespace

struct DifferentiableMlp::Layers {
    explicit Layers(const Model& given) : model(given)
    {
        for (const DenseLayer& layer : model.layers) {
            std::vector<double> columns(layer.weight.size());
            for (std::size_t j = 0; j < layer.outputs; ++j) {
                for (std::size_t i = 0; i < layer.inputs; ++i) {
                    columns[i * layer.outputs + j] = layer.weight[j * layer.inputs + i];
                }
            }
            transposed.push_back(std::move(columns));
        }
    }

    Model model;  // of which the layers and the activation are used
    std::vector<std::vector<double>> transposed;
};

namespace {

[[nodiscard]] std::size_t count_of(const Model& model) noexcept
{
    std::size_t count = 0;
    for (const DenseLayer& layer : model.layers) count += layer.weight.size() + layer.bias.size();
    return count;
}

}  // namespace

DifferentiableMlp::DifferentiableMlp(const Model& model)
    : mlp_(model), count_(count_of(model)), layers_(std::make_shared<const Layers>(model))
{
}

std::vector<double> DifferentiableMlp::values() const
{
    std::vector<double> out;
    out.reserve(count_);
    for (const DenseLayer& layer : layers_->model.layers) {
        out.insert(out.end(), layer.weight.begin(), layer.weight.end());
        out.insert(out.end(), layer.bias.begin(), layer.bias.end());
    }
    return out;
}

DifferentiableMlp DifferentiableMlp::with(std::span<const double> values) const
{
    if (values.size() != count_) {
        detail::Refuse{"DifferentiableMlp"}(
            fmt::format("found {} parameters, expected {}", values.size(), count_));
    }
    Model model = layers_->model;
    const double* from = values.data();
    for (DenseLayer& layer : model.layers) {
        for (std::vector<double>* numbers : {&layer.weight, &layer.bias}) {
            std::copy_n(from, numbers->size(), numbers->begin());
            from += numbers->size();
        }
    }
    return DifferentiableMlp(model);
}

void DifferentiableMlp::vjp(const double* in, const double* weights, double* by_in,
                            double* by_parameters) const noexcept
{
    const std::vector<DenseLayer>& layers = layers_->model.layers;
    const bool relu = layers_->model.activation == Activation::relu;
    // The outputs of all hidden layers, one row each, as long as the widest needs.
    thread_local std::vector<double> memory;
    std::size_t row = 2 * lanes;
    for (const DenseLayer& layer : layers)
        row = std::max(row, layer.outputs + layer.inputs + lanes);
    row = (row + lanes - 1) / lanes * lanes;
    const std::size_t alignment = kernel::block_bytes / sizeof(double);
    row = (row + alignment - 1) / alignment * alignment;
    if (memory.size() < (layers.size() + 3) * row) memory.resize((layers.size() + 3) * row);
    double* const first =
        memory.data() +
        (alignment - reinterpret_cast<std::uintptr_t>(memory.data()) / sizeof(double) % alignment) %
            alignment;
    const auto outputs_of = [&](std::size_t k) { return first + k * row; };

    const double* x = in;
    for (std::size_t k = 0; k + 1 < layers.size(); ++k) {
        const DenseLayer& layer = layers[k];
        double* y = outputs_of(k);
        std::copy(layer.bias.begin(), layer.bias.end(), y);
        for (std::size_t i = 0; i < layer.inputs; ++i) {
            add_multiple(y, x[i], layers_->transposed[k].data() + i * layer.outputs, layer.outputs);
        }
        if (relu) {
            for (std::size_t j = 0; j < layer.outputs; ++j) y[j] = y[j] > 0 ? y[j] : 0;
        } else {
            tanh_all(y, layer.outputs);
        }
        x = y;
    }

    double* back = outputs_of(layers.size());
    double* next = outputs_of(layers.size() + 1);
    std::copy_n(weights, layers.back().outputs, back);
    double* by = by_parameters + count_;
    for (std::size_t k = layers.size(); k-- > 0;) {
        const DenseLayer& layer = layers[k];
        by -= layer.weight.size() + layer.bias.size();
        const double* from = k == 0 ? in : outputs_of(k - 1);
        double* to = k == 0 ? by_in : next;
        if (k > 0) std::fill_n(to, layer.inputs, 0.0);
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            if (back[j] == 0) continue;
            add_multiple(by + j * layer.inputs, back[j], from, layer.inputs);
            add_multiple(to, back[j], layer.weight.data() + j * layer.inputs, layer.inputs);
        }
        add_multiple(by + layer.weight.size(), 1, back, layer.outputs);
        if (k == 0) return;
        for (std::size_t i = 0; i < layer.inputs; ++i) {
            to[i] *= relu ? (from[i] > 0 ? 1.0 : 0.0) : 1 - from[i] * from[i];
        }
        std::swap(back, next);
    }
}

}  // namespace ricochet
