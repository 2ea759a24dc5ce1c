// Networks as guards: a learned contact surface, a signed distance, a neural event function.
//
//     struct Ball {
//         GuardNetwork surface{load_model("surface.safetensors")};
//         template <class S>
//         S guard(const S&, const std::array<S, 4>& x) const { return surface(x[0], x[1]); }
//         void reset(double, State& x) const { const auto n = surface.normal(x[0], x[1]); ... }
//     };
//
// One call operator serves numbers, dual numbers, which give the rate of the guard, and enclosures,
// with which `Enclosed` proves that no event is lost (enclosed.hpp). The arithmetic is that of
// doubles whatever the precision in which the weights are stored, so that an event is located as
// closely as that of a formula.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet {

namespace detail {

/// One layer: y = activation(W x + b), to which a residual layer adds x. The last has no
/// activation.
struct GuardLayer {
    std::size_t inputs = 0;
    std::size_t outputs = 0;
    std::size_t row = 0;                 ///< outputs, rounded up to whole blocks; 1 for the last
    const double* parameters = nullptr;  ///< a row of biases, then a row of weights for each input
    /// Bounds of the rounding of an output: by the largest input, and for inputs of 0.
    const double* rounding = nullptr;
    bool is_residual = false;
};

struct GuardLayers {
    const GuardLayer* layers = nullptr;
    std::size_t count = 0;
    const double* offset = nullptr;  ///< of the inputs
    const double* scale = nullptr;
};

struct GuardRange {
    double centre, slope, radius;
};

struct GuardKernels;

/// An enclosure (enclosure.hpp), which this room does not know.
template <class S>
concept IsEnclosure = requires(const S& x)
{
    S{x.centre, x.slope, x.radius};
};

/// A dual number (dual.hpp) with derivatives that are numbers.
template <class S>
concept IsDual = requires(const S& x)
{
    requires std::is_same_v < std::remove_cvref_t<decltype(x.value)>,
    double > ;
    x.slope.size();
};

}  // namespace detail

/// A network with one output, as a function of a state or of a part of it:
///
///     x_0 = (in - offset) scale,  x_k+1 = activation(W_k x_k + b_k) [+ x_k],  out = W_n x_n + b_n
///
/// with ReLU, tanh, softplus, SiLU or sine after the hidden layers, which may be residual.
/// Immutable, so threads may share it; copies share the parameters. Evaluation allocates nothing.
class GuardNetwork {
public:
    static constexpr std::size_t max_width = 512;  ///< largest width of a layer, and of the input
    static constexpr std::size_t max_layers = 16;

    /// @throws std::invalid_argument if the layers do not fit together, if their width or number
    /// exceeds the limits, if there is not exactly one output, if a residual layer is the last or
    /// has other numbers of inputs and outputs, or if a weight is not finite.
    explicit GuardNetwork(const Model& model);

    [[nodiscard]] std::size_t inputs() const noexcept { return inputs_; }

    /// @param x  `inputs()` values
    [[nodiscard]] double value(const double* x) const noexcept;
    /// The value, and in `rate` its derivative along dx.
    [[nodiscard]] double value_and_rate(const double* x, const double* dx,
                                        double& rate) const noexcept;
    /// The value, and its derivatives by the `inputs()` inputs. A kink has those of the side of 0.
    [[nodiscard]] double value_and_gradient(const double* x, double* gradient) const noexcept;
    /// Range of the value where input i is centre[i] + slope[i] tau +- radius[i] with -1 <= tau <=
    /// 1, as such a sum, rounded outward: of the exact value, and of what `value` computes.
    [[nodiscard]] detail::GuardRange range(const double* centre, const double* slope,
                                           const double* radius) const noexcept;

    /// The value of numbers, duals or enclosures, one for each input.
    /// @throws std::invalid_argument if their number is not `inputs()`.
    template <class S, std::size_t n>
    [[nodiscard]] S operator()(const std::array<S, n>& x) const
    {
        if (n != inputs_) throw_wrong_inputs(n);
        return of(x);
    }
    template <class S, class... Rest>
    requires(std::is_same_v<S, Rest>&&...) [[nodiscard]] S operator()(const S& x,
                                                                      const Rest&... rest) const
    {
        return (*this)(std::array<S, 1 + sizeof...(Rest)>{x, rest...});
    }

    /// The gradient divided by its length: the normal of the surface, on the side on which the
    /// guard is positive. Zeros where the gradient is 0.
    template <std::size_t n>
    [[nodiscard]] std::array<double, n> normal(const std::array<double, n>& x) const
    {
        if (n != inputs_) throw_wrong_inputs(n);
        std::array<double, n> gradient;
        static_cast<void>(value_and_gradient(x.data(), gradient.data()));
        double square = 0;
        for (const double d : gradient) square += d * d;
        const double factor = square > 0 ? 1 / std::sqrt(square) : 0;
        for (double& d : gradient) d *= factor;
        return gradient;
    }
    template <class... Rest>
    requires(std::is_same_v<double, Rest>&&...)
        [[nodiscard]] auto normal(double x, Rest... rest) const
    {
        return normal(std::array<double, 1 + sizeof...(Rest)>{x, rest...});
    }

private:
    [[noreturn]] void throw_wrong_inputs(std::size_t given) const;

    template <std::size_t n>
    [[nodiscard]] double of(const std::array<double, n>& x) const noexcept
    {
        return value(x.data());
    }
    template <detail::IsEnclosure S, std::size_t n>
    [[nodiscard]] S of(const std::array<S, n>& x) const noexcept
    {
        std::array<double, n> centre, slope, radius;
        for (std::size_t i = 0; i < n; ++i) {
            centre[i] = x[i].centre;
            slope[i] = x[i].slope;
            radius[i] = x[i].radius;
        }
        const detail::GuardRange of = range(centre.data(), slope.data(), radius.data());
        return S{of.centre, of.slope, of.radius};
    }
    template <detail::IsDual S, std::size_t n>
    [[nodiscard]] S of(const std::array<S, n>& x) const noexcept
    {
        std::array<double, n> at, along;
        for (std::size_t i = 0; i < n; ++i) at[i] = x[i].value;
        S g;
        if (x[0].slope.size() == 1) {
            for (std::size_t i = 0; i < n; ++i) along[i] = x[i].slope[0];
            g.value = value_and_rate(at.data(), along.data(), g.slope[0]);
            return g;
        }
        g.value = value_and_gradient(at.data(), along.data());
        for (std::size_t i = 0; i < n; ++i) {
            for (std::size_t k = 0; k < g.slope.size(); ++k) g.slope[k] += along[i] * x[i].slope[k];
        }
        return g;
    }
    /// Any other scalar, such as a power series, by the formula.
    template <class S, std::size_t n>
    [[nodiscard]] S of(const std::array<S, n>& x) const
    {
        std::vector<S> in(n);
        for (std::size_t i = 0; i < n; ++i) in[i] = (x[i] - layers_.offset[i]) * layers_.scale[i];
        for (std::size_t k = 0; k < layers_.count; ++k) {
            const detail::GuardLayer& layer = layers_.layers[k];
            std::vector<S> out(layer.outputs);
            for (std::size_t j = 0; j < layer.outputs; ++j) {
                S sum = S(layer.parameters[j]);
                for (std::size_t i = 0; i < layer.inputs; ++i) {
                    sum = sum + layer.parameters[(i + 1) * layer.row + j] * in[i];
                }
                out[j] = k + 1 < layers_.count ? activated(sum) : sum;
                if (layer.is_residual) out[j] = out[j] + in[j];
            }
            in = out;
        }
        return in[0];
    }
    template <class S>
    [[nodiscard]] S activated(const S& x) const
    {
        using std::exp, std::log, std::sin, std::tanh;
        switch (activation_) {
            case Activation::relu: return x > 0 ? x : S(0.0);
            case Activation::tanh: return tanh(x);
            case Activation::softplus: return x > 0 ? x + log(1.0 + exp(-x)) : log(1.0 + exp(x));
            case Activation::silu: return x * (0.5 + 0.5 * tanh(0.5 * x));
            case Activation::sine: return sin(x);
        }
        return x;
    }

    std::size_t inputs_ = 0;
    Activation activation_;
    detail::GuardLayers layers_;
    const detail::GuardKernels* kernels_ = nullptr;
    detail::Shared<void> memory_;
};

}  // namespace ricochet
