// Networks inside a system whose runs are differentiated.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet {

/// A perceptron with the derivatives of its outputs by its inputs and its parameters, for the flow,
/// the guard or the reset of a system:
///
///     double guard(double, const State& x) const
///     {
///         double g;
///         network.forward(x.data(), &g);
///         return g;
///     }
///     void guard_vjp(double, const State& x, double weight, const Cotangent& to) const
///     {
///         network.vjp(x.data(), &weight, to.x.data(), to.p.data());
///     }
///
/// Parameters are numbered layer by layer, in each layer the weights row by row (outputs x inputs)
/// and then the biases, as `torch.nn.Linear` lists them. Offset, scale and threshold of the model
/// are not applied, as by `Mlp`. ReLU has the derivative 0 at 0. Immutable, so that threads may
/// use it together; copies have common parameters.
class DifferentiableMlp {
public:
    /// @throws std::invalid_argument as `Mlp`
    explicit DifferentiableMlp(const Model& model);

    [[nodiscard]] std::size_t inputs() const noexcept { return mlp_.inputs(); }
    [[nodiscard]] std::size_t outputs() const noexcept { return mlp_.outputs(); }
    [[nodiscard]] std::size_t parameters() const noexcept { return count_; }
    /// The values of the parameters.
    [[nodiscard]] std::vector<double> values() const;
    /// The same network with other values.
    /// @throws std::invalid_argument unless there are `parameters()` of them
    [[nodiscard]] DifferentiableMlp with(std::span<const double> values) const;

    /// Reads `inputs()` numbers and writes `outputs()`: the bits of `Mlp<double>`.
    void forward(const double* in, double* out) const noexcept { mlp_.forward(in, out); }

    /// Adds the derivatives of weights . out by the inputs to `by_in`, and those by the parameters
    /// to `by_parameters`.
    void vjp(const double* in, const double* weights, double* by_in,
             double* by_parameters) const noexcept;

private:
    struct Layers;
    Mlp<double> mlp_;
    std::size_t count_;
    std::shared_ptr<const Layers> layers_;
};

}  // namespace ricochet
