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

namespace {

/// Memory of this thread in rows that begin at blocks, each long enough for every layer.
class Rows {
public:
    explicit Rows(const std::vector<DenseLayer>& layers)
    {
        constexpr std::size_t block = kernel::block<double>;
        for (const DenseLayer& layer : layers) {
            width_ = std::max({width_, layer.inputs, layer.outputs});
        }
        width_ = (width_ + block - 1) / block * block;
        thread_local std::vector<double> memory;
        const std::size_t size = (layers.size() + 2) * width_ + block;
        if (memory.size() < size) memory.resize(size);
        const auto at = reinterpret_cast<std::uintptr_t>(memory.data()) / sizeof(double);
        first_ = memory.data() + (block - at % block) % block;
    }
    [[nodiscard]] double* operator[](std::size_t k) const noexcept { return first_ + k * width_; }

private:
    std::size_t width_ = 0;
    double* first_;
};

/// The outputs of a hidden layer, by columns of weights.
void evaluate(const DenseLayer& layer, const std::vector<double>& columns, bool relu,
              const double* x, double* y) noexcept
{
    std::copy(layer.bias.begin(), layer.bias.end(), y);
    for (std::size_t i = 0; i < layer.inputs; ++i) {
        add_multiple(y, x[i], columns.data() + i * layer.outputs, layer.outputs);
    }
    if (relu) {
        for (std::size_t j = 0; j < layer.outputs; ++j) y[j] = y[j] > 0 ? y[j] : 0;
    } else {
        tanh_all(y, layer.outputs);
    }
}

/// Adds the products of the weights `back` with the derivatives of a layer.
void add_products(const DenseLayer& layer, const double* back, const double* x, double* by_x,
                  double* by_parameters) noexcept
{
    for (std::size_t j = 0; j < layer.outputs; ++j) {
        if (back[j] == 0) continue;
        add_multiple(by_parameters + j * layer.inputs, back[j], x, layer.inputs);
        add_multiple(by_x, back[j], layer.weight.data() + j * layer.inputs, layer.inputs);
    }
    add_multiple(by_parameters + layer.weight.size(), 1, back, layer.outputs);
}

}  // namespace

void DifferentiableMlp::vjp(const double* in, const double* weights, double* by_in,
                            double* by_parameters) const noexcept
{
    const std::vector<DenseLayer>& layers = layers_->model.layers;
    const bool relu = layers_->model.activation == Activation::relu;
    const Rows rows(layers);  // the outputs of the hidden layers, then two rows of weights
    const auto input_of = [&](std::size_t k) { return k == 0 ? in : rows[k - 1]; };
    for (std::size_t k = 0; k + 1 < layers.size(); ++k) {
        evaluate(layers[k], layers_->transposed[k], relu, input_of(k), rows[k]);
    }

    double* back = rows[layers.size()];
    double* next = rows[layers.size() + 1];
    std::copy_n(weights, layers.back().outputs, back);
    double* by = by_parameters + count_;
    for (std::size_t k = layers.size(); k-- > 1;) {
        const DenseLayer& layer = layers[k];
        by -= layer.weight.size() + layer.bias.size();
        const double* x = input_of(k);
        std::fill_n(next, layer.inputs, 0.0);
        add_products(layer, back, x, next, by);
        for (std::size_t i = 0; i < layer.inputs; ++i) {
            next[i] *= relu ? (x[i] > 0 ? 1.0 : 0.0) : 1 - x[i] * x[i];
        }
        std::swap(back, next);
    }
    add_products(layers.front(), back, in, by_in, by_parameters);
}

}  // namespace ricochet
