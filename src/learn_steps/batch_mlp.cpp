#include "batch_mlp.hpp"

#include <algorithm>
#include <cmath>

namespace ricochet::learn {

template <class T>
BatchMlp<T>::BatchMlp(std::size_t inputs, std::span<const std::size_t> hidden, std::size_t outputs,
                      bool relu_at_end)
    : kernels_(&dense_kernels<T>())
{
    std::vector<std::size_t> widths(hidden.begin(), hidden.end());
    if (outputs > 0) widths.push_back(outputs);
    for (std::size_t k = 0; k < widths.size(); ++k) {
        const std::size_t out = widths[k];
        const std::size_t weight = size_;
        const std::size_t bias = weight + inputs * padded<T>(out);
        shapes_.push_back({.inputs = inputs,
                           .outputs = out,
                           .weight = weight,
                           .bias = bias,
                           .transposed = transposed_size_,
                           .relu = relu_at_end || k + 1 < widths.size()});
        size_ = bias + padded<T>(out);
        transposed_size_ += out * padded<T>(inputs);
        inputs = out;
    }
}

template <class T>
void BatchMlp<T>::initialise(T* parameters, Random& random) const
{
    std::fill(parameters, parameters + size_, T(0));
    for (const Shape& shape : shapes_) {
        const double bound = 1 / std::sqrt(static_cast<double>(shape.inputs));
        const std::size_t stride = padded<T>(shape.outputs);
        for (std::size_t i = 0; i <= shape.inputs; ++i) {  // the bias follows the weight
            for (std::size_t j = 0; j < shape.outputs; ++j) {
                parameters[shape.weight + i * stride + j] =
                    static_cast<T>(random.uniform(-bound, bound));
            }
        }
    }
}

template <class T>
void BatchMlp<T>::transpose(const T* parameters, T* transposed) const
{
    for (const Shape& shape : shapes_) {
        learn::transpose(parameters + shape.weight, padded<T>(shape.outputs), shape.inputs,
                         shape.outputs, transposed + shape.transposed, padded<T>(shape.inputs));
    }
}

template <class T>
typename BatchMlp<T>::Work BatchMlp<T>::work(std::size_t rows) const
{
    Work work;
    for (const Shape& shape : shapes_) {
        work.values.emplace_back(rows * padded<T>(shape.outputs));
        work.slopes.emplace_back(rows * padded<T>(shape.outputs));
    }
    return work;
}

template <class T>
Rows<T> BatchMlp<T>::forward(const T* parameters, Rows<const T> x, std::size_t rows,
                             Work& work) const
{
    for (std::size_t k = 0; k < shapes_.size(); ++k) {
        const Shape& shape = shapes_[k];
        const std::size_t stride = padded<T>(shape.outputs);
        T* out = work.values[k].data();
        kernels_->product({.a = x.data,
                           .a_stride = x.stride,
                           .b = parameters + shape.weight,
                           .b_stride = stride,
                           .c = out,
                           .c_stride = stride,
                           .rows = rows,
                           .inner = shape.inputs,
                           .columns = stride,
                           .bias = parameters + shape.bias},
                          shape.relu ? After::relu : After::nothing);
        x = {out, stride};
    }
    return {work.values.back().data(), padded<T>(outputs())};
}

template <class T>
void BatchMlp<T>::backward(const T* transposed, Rows<const T> x, std::size_t rows, Work& work,
                           T* gradient, T* dx) const
{
    for (std::size_t k = shapes_.size(); k-- > 0;) {
        const Shape& shape = shapes_[k];
        const std::size_t out = padded<T>(shape.outputs);
        const std::size_t in = padded<T>(shape.inputs);
        const Rows<const T> before = k > 0 ? Rows<const T>{work.values[k - 1].data(), in} : x;
        const T* slopes = work.slopes[k].data();
        if (gradient) {
            kernels_->outer_product({.a = before.data,
                                     .a_stride = before.stride,
                                     .b = slopes,
                                     .b_stride = out,
                                     .c = gradient + shape.weight,
                                     .c_stride = out,
                                     .rows = rows,
                                     .left = shape.inputs,
                                     .columns = out,
                                     .sums = gradient + shape.bias});
        }
        T* to = k > 0 ? work.slopes[k - 1].data() : dx;
        if (!to) continue;
        const bool masked = k > 0 && shapes_[k - 1].relu;
        kernels_->product({.a = slopes,
                           .a_stride = out,
                           .b = transposed + shape.transposed,
                           .b_stride = in,
                           .c = to,
                           .c_stride = in,
                           .rows = rows,
                           .inner = shape.outputs,
                           .columns = in,
                           .mask = masked ? before.data : nullptr},
                          masked ? After::mask : After::nothing);
    }
}

template <class T>
std::vector<DenseLayer> BatchMlp<T>::layers(const T* parameters) const
{
    std::vector<DenseLayer> out;
    for (const Shape& shape : shapes_) {
        DenseLayer layer{
            .inputs = shape.inputs, .outputs = shape.outputs, .weight = {}, .bias = {}};
        const std::size_t stride = padded<T>(shape.outputs);
        for (std::size_t j = 0; j < shape.outputs; ++j) {
            for (std::size_t i = 0; i < shape.inputs; ++i) {
                layer.weight.push_back(
                    static_cast<double>(parameters[shape.weight + i * stride + j]));
            }
            layer.bias.push_back(static_cast<double>(parameters[shape.bias + j]));
        }
        out.push_back(std::move(layer));
    }
    return out;
}

template <class T>
void BatchMlp<T>::assign(const std::vector<DenseLayer>& layers, T* parameters) const
{
    for (std::size_t k = 0; k < shapes_.size(); ++k) {
        const Shape& shape = shapes_[k];
        const std::size_t stride = padded<T>(shape.outputs);
        for (std::size_t j = 0; j < shape.outputs; ++j) {
            for (std::size_t i = 0; i < shape.inputs; ++i) {
                parameters[shape.weight + i * stride + j] =
                    static_cast<T>(layers.at(k).weight.at(j * shape.inputs + i));
            }
            parameters[shape.bias + j] = static_cast<T>(layers.at(k).bias.at(j));
        }
    }
}

template <class T>
void transpose(const T* a, std::size_t a_stride, std::size_t m, std::size_t n, T* out,
               std::size_t out_stride)
{
    constexpr std::size_t block = 16;  // its rows and columns stay in the cache
    for (std::size_t i0 = 0; i0 < m; i0 += block) {
        for (std::size_t j = 0; j < n; ++j) {
            for (std::size_t i = i0; i < std::min(m, i0 + block); ++i) {
                out[j * out_stride + i] = a[i * a_stride + j];
            }
        }
    }
}

template void transpose(const float*, std::size_t, std::size_t, std::size_t, float*, std::size_t);
template void transpose(const double*, std::size_t, std::size_t, std::size_t, double*, std::size_t);
template class BatchMlp<float>;
template class BatchMlp<double>;

}  // namespace ricochet::learn
