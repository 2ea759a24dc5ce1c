// A multilayer perceptron whose weights can be trained.
//
// Hidden layers have one activation, and the last layer is linear. All numbers are
// double, and every sum has a fixed order, so that the result depends on
// neither the number of threads nor the width of the vector registers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::learn {

/// A network whose parameters are one vector: layer by layer the weight, outputs x inputs row by
/// row, then the bias.
class TrainableMlp {
public:
    /// Weights uniform within +-sqrt(6 / inputs) for ReLU (He et al., 2015) and
    /// +-sqrt(6 / (inputs + outputs)) for tanh and the last layer (Glorot and
    /// Bengio, 2010); biases zero.
    /// @throws std::invalid_argument if a width is zero.
    TrainableMlp(std::size_t inputs, std::span<const std::size_t> hidden, Activation activation,
                 Random& random, std::size_t outputs = 1);

    [[nodiscard]] std::size_t inputs() const noexcept { return shapes_.front().inputs; }
    [[nodiscard]] std::span<double> parameters() noexcept { return parameters_; }
    [[nodiscard]] std::span<const double> parameters() const noexcept { return parameters_; }

    [[nodiscard]] std::size_t outputs() const noexcept { return shapes_.back().outputs; }

    /// Logits of n states.
    /// @param states  n x inputs, row by row, after offset and scale
    /// @param logits  n x outputs, row by row, written
    void evaluate(std::span<const double> states, std::span<double> logits);

    /// Mean binary cross entropy of n states, and its gradient:
    ///
    ///     L = 1/n sum log(1 + exp(z)) - y z
    ///
    /// @param states    n x inputs, row by row, after offset and scale
    /// @param labels    n, each 0 or 1
    /// @param gradient  one per parameter, written
    double loss_and_gradient(std::span<const double> states, std::span<const std::uint8_t> labels,
                             std::span<double> gradient);

    /// The loss of state i with these logits; writes its derivative by each logit.
    using Loss = std::function<double(std::size_t i, const double* logits, double* slopes)>;

    /// The mean of any loss over n states, and its gradient.
    double loss_and_gradient(std::span<const double> states, std::size_t n, const Loss& loss,
                             std::span<double> gradient);

    /// The parameters as layers of a model.
    [[nodiscard]] std::vector<DenseLayer> layers() const;

private:
    struct Shape {
        std::size_t inputs;
        std::size_t outputs;
        std::size_t weight;  ///< where its weight starts among the parameters
        std::size_t bias;
    };

    void load(std::span<const double> states, std::size_t n);
    void forward();
    void backward(std::span<double> gradient);

    Activation activation_;
    std::vector<Shape> shapes_;
    std::vector<double> parameters_;
    std::size_t lanes_ = 0;                         ///< states in the work space, in whole blocks
    std::vector<std::vector<double>> activations_;  ///< per layer, width x lanes; 0: the input
    std::vector<std::vector<double>> slopes_;       ///< dL/d of the input of the activation
    std::vector<double> logits_, logit_slopes_;     ///< of one state
};

/// log(1 + exp(z)) - y z, without overflow.
[[nodiscard]] double cross_entropy(double logit, bool event) noexcept;

}  // namespace ricochet::learn
