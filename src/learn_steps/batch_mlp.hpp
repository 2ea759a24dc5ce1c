// Multilayer perceptrons on batches, forward and backward.
//
//     x_0 = x,  x_k+1 = max(0, W_k x_k + b_k),  y = W_n x_n + b_n
//
// The class holds a shape and its arithmetic. The caller owns the memory of parameters, gradients
// and layer outputs, so that several networks can share one vector, and threads one network.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "aligned.hpp"
#include "learn/dense.hpp"
#include "ricochet/base/random.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::learn {

/// A matrix of samples, row by row.
template <class T>
struct Rows {
    T* data;
    std::size_t stride;  ///< whole cache lines; beyond the columns the rows are zero

    [[nodiscard]] T* row(std::size_t i) const noexcept { return data + i * stride; }
};

/// Parameters: layer by layer the weight, inputs x outputs row by row, then the bias, with each row
/// padded with zeros to whole cache lines.
template <class T>
class BatchMlp {
public:
    /// Outputs of the layers for a batch, and the derivatives of a loss by them.
    struct Work {
        std::vector<Buffer<T>> values;  ///< of layer k, rows x padded outputs
        std::vector<Buffer<T>> slopes;
    };

    /// @param relu_at_end  the last layer is followed by a ReLU too
    BatchMlp(std::size_t inputs, std::span<const std::size_t> hidden, std::size_t outputs,
             bool relu_at_end = false);

    [[nodiscard]] std::size_t inputs() const noexcept { return shapes_.front().inputs; }
    [[nodiscard]] std::size_t outputs() const noexcept { return shapes_.back().outputs; }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }  ///< of the parameters
    /// Number of the transposed weights.
    [[nodiscard]] std::size_t transposed_size() const noexcept { return transposed_size_; }

    /// Initial values like PyTorch's: weights and biases uniform within +-1 / sqrt(inputs).
    void initialise(T* parameters, Random& random) const;

    /// Transposes the weights for `backward`.
    void transpose(const T* parameters, T* transposed) const;

    [[nodiscard]] Work work(std::size_t rows) const;

    /// Writes `work.values`; returns those of the last layer.
    Rows<T> forward(const T* parameters, Rows<const T> x, std::size_t rows, Work& work) const;

    /// From the derivatives by the output, in `slopes_out(work)`, computes the derivatives by the
    /// parameters, written to `gradient` (null: omitted), and by the inputs, written to `dx` with
    /// a stride of padded(inputs) (null: omitted). Call after `forward` with the same x and work.
    void backward(const T* transposed, Rows<const T> x, std::size_t rows, Work& work, T* gradient,
                  T* dx) const;

    [[nodiscard]] Rows<T> slopes_out(Work& work) const
    {
        return {work.slopes.back().data(), padded<T>(outputs())};
    }

    /// The parameters as layers of a model.
    [[nodiscard]] std::vector<DenseLayer> layers(const T* parameters) const;

    /// Sets the parameters from layers of this shape.
    void assign(const std::vector<DenseLayer>& layers, T* parameters) const;

private:
    struct Shape {
        std::size_t inputs;
        std::size_t outputs;
        std::size_t weight;  ///< where it begins
        std::size_t bias;
        std::size_t transposed;
        bool relu;
    };

    std::vector<Shape> shapes_;
    std::size_t size_ = 0;
    std::size_t transposed_size_ = 0;
    const DenseKernels<T>* kernels_;
};

/// a transposed, n x m, from m x n, both row by row with strides.
template <class T>
void transpose(const T* a, std::size_t a_stride, std::size_t m, std::size_t n, T* out,
               std::size_t out_stride);

extern template class BatchMlp<float>;
extern template class BatchMlp<double>;

}  // namespace ricochet::learn
