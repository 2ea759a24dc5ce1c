// Networks that are ready to be evaluated: a perceptron, a classifier, and one with a certificate.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/nn/detail/pack.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet {

// Evaluation of a multilayer perceptron whose shape is known at run time.
//
// The kernels are compiled into the library for several instruction sets; the best one that the
// processor supports is chosen once, at start. Common shapes have specialised instances. The result
// does not depend on these choices: for the same parameters and input every instruction set, every
// instance and `StaticMlp` return the same bits.

/// Instruction set that a kernel is compiled for. Processors other than x86-64 have the baseline
/// only.
enum class InstructionSet {
    baseline,   ///< whatever the library is compiled for, e.g. SSE2
    x86_64_v3,  ///< AVX2
    x86_64_v4,  ///< AVX-512
};

/// Name of an instruction set as gcc spells it: "baseline", "x86-64-v3" or "x86-64-v4".
[[nodiscard]] std::string_view name(InstructionSet set) noexcept;

/// Whether this build has kernels for `set` and this processor runs them.
[[nodiscard]] bool supported(InstructionSet set) noexcept;

/// The fastest instruction set that is supported.
[[nodiscard]] InstructionSet best_instruction_set() noexcept;

namespace detail {

/// Input of a kernel; the pointers refer to memory that an `Mlp` owns.
template <class T>
struct Network {
    const T* parameters = nullptr;          ///< as `pack` stores them, aligned to 64 bytes
    const std::uint16_t* widths = nullptr;  ///< layers + 1
    std::size_t layers = 0;
};

/// Evaluates `samples` rows of inputs one after the other.
template <class T>
using Kernel = void (*)(const Network<T>&, const T* in, T* out, std::size_t samples) noexcept;

}  // namespace detail

/// Options of the inference.
struct MlpOptions {
    InstructionSet instruction_set = best_instruction_set();
    bool common_shapes = true;  ///< use a specialised instance for a common shape
};

/// A network in the arithmetic of T, float or double.
///
///     x_0 = in,  x_k+1 = activation(W_k x_k + b_k),  out = W_n x_n + b_n
///
/// Immutable, so threads may share it; copies share the parameters. Evaluation
/// allocates nothing, keeps its activations on the stack, and propagates NaN and
/// infinity as the formula does. Offset, scale and threshold of the model
/// are not applied: see `Classifier`.
template <class T>
class Mlp {
public:
    static constexpr std::size_t max_width = 256;  ///< largest width of a layer, and of the input
    static constexpr std::size_t max_layers = 64;

    /// @throws std::invalid_argument if the layers do not fit together, if their width
    /// or number exceeds the limits, or if the instruction set is not supported.
    explicit Mlp(const Model& model, const MlpOptions& options = {});

    /// Reads `inputs()` values and writes `outputs()`.
    void forward(const T* in, T* out) const noexcept { kernel_(network_, in, out, 1); }

    /// Reads `samples` rows of `inputs()` values each, and writes as many rows of
    /// `outputs()`; the bits are those of single evaluations.
    void forward_batch(const T* in, std::size_t samples, T* out) const noexcept
    {
        kernel_(network_, in, out, samples);
    }

    [[nodiscard]] std::size_t inputs() const noexcept { return network_.widths[0]; }
    [[nodiscard]] std::size_t outputs() const noexcept { return network_.widths[network_.layers]; }

private:
    detail::Network<T> network_;
    detail::Kernel<T> kernel_;
    detail::Shared<void> memory_;
};

extern template class Mlp<float>;
extern template class Mlp<double>;

// Evaluation of a multilayer perceptron whose shape is known at compile time.
//
// Compiled with the caller's flags, e.g. -O2 -march=x86-64-v3, and inlined. The
// result has the same bits as that of `Mlp` for all flags except those that
// give up IEEE arithmetic (-ffast-math).

/// A network with `Widths` values between its layers, the inputs first and the
/// outputs last, in the arithmetic of T, float or double. A value, so it may be
/// copied, and shared by threads.
template <Activation activation, class T, std::size_t... Widths>
class BasicStaticMlp {
    static_assert(sizeof...(Widths) >= 2, "inputs and outputs at least");
    static_assert(((Widths > 0 && Widths <= 256) && ...), "widths from 1 to 256");

public:
    /// @throws std::invalid_argument if the model has another shape or activation.
    explicit BasicStaticMlp(const Model& model)
    {
        detail::check_layers(model, "StaticMlp");
        if (model.activation != activation) {
            throw std::invalid_argument("StaticMlp: the model has another activation");
        }
        if (model.layers.size() != widths.size() - 1) {
            throw std::invalid_argument("StaticMlp: expected " + std::to_string(widths.size() - 1) +
                                        " layers, found " + std::to_string(model.layers.size()));
        }
        for (std::size_t k = 0; k < model.layers.size(); ++k) {
            const DenseLayer& layer = model.layers[k];
            if (layer.inputs != widths[k] || layer.outputs != widths[k + 1]) {
                throw std::invalid_argument(
                    "StaticMlp: expected layer " + std::to_string(k) + " of shape " +
                    std::to_string(widths[k + 1]) + " x " + std::to_string(widths[k]) + ", found " +
                    std::to_string(layer.outputs) + " x " + std::to_string(layer.inputs));
            }
        }
        detail::RICOCHET_KERNEL_NAMESPACE::pack(model, parameters_.data());
    }

    // Inlined without exception, so that translation units with different flags do
    // not share one definition; the same holds for every function that it calls.
    /// Reads `inputs()` values and writes `outputs()`.
    RICOCHET_INLINE void forward(const T* in, T* out) const noexcept
    {
        detail::RICOCHET_KERNEL_NAMESPACE::evaluate<T, activation == Activation::relu, Widths...>(
            parameters_.data(), in, out);
    }

    /// Reads `samples` rows of inputs, and writes as many rows of outputs.
    RICOCHET_INLINE void forward_batch(const T* in, std::size_t samples, T* out) const noexcept
    {
        for (std::size_t i = 0; i < samples; ++i) {
            forward(in + i * widths.front(), out + i * widths.back());
        }
    }

    [[nodiscard]] static constexpr std::size_t inputs() noexcept { return widths.front(); }
    [[nodiscard]] static constexpr std::size_t outputs() noexcept { return widths.back(); }

private:
    static constexpr std::array<std::size_t, sizeof...(Widths)> widths{Widths...};

    static constexpr std::size_t size()
    {
        std::size_t sum = 0;
        for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
            sum += detail::RICOCHET_KERNEL_NAMESPACE::layer_size<T>(widths[k], widths[k + 1],
                                                                    k + 2 == widths.size());
        }
        return sum;
    }

    alignas(64) std::array<T, size()> parameters_;
};

/// Network with max(0, x) after the hidden layers: `StaticMlp<float, 4, 16, 16, 1>`.
template <class T, std::size_t... Widths>
using StaticMlp = BasicStaticMlp<Activation::relu, T, Widths...>;

/// Network with tanh(x) after the hidden layers.
template <class T, std::size_t... Widths>
using StaticTanhMlp = BasicStaticMlp<Activation::tanh, T, Widths...>;

// A model that is ready to predict whether a step meets an event.

/// Evaluates a model on raw features,
///
///     logits = mlp((features - offset) * scale)
///
/// with the features normalised in double, where the small differences between
/// times or positions survive, and the network in the precision of the model.
/// Immutable, allocation-free after construction, shared by threads.
class Classifier {
public:
    /// @throws std::invalid_argument if offset, scale or domain do not have one
    /// entry per input (an empty domain is unbounded), or if `Mlp` throws it.
    explicit Classifier(Model model, const MlpOptions& options = {});

    [[nodiscard]] const Model& model() const noexcept { return model_; }
    [[nodiscard]] std::size_t inputs() const noexcept { return inputs_; }
    [[nodiscard]] std::size_t outputs() const noexcept { return outputs_; }

    /// Reads `inputs()` features, writes `outputs()` logits.
    void logits(const double* features, double* out) const noexcept;

    /// The first logit.
    [[nodiscard]] double logit(const double* features) const noexcept;

    /// Whether `logit` announces an event: it is not below the threshold. NaN
    /// announces an event.
    [[nodiscard]] bool alarm(double logit) const noexcept { return !(logit < threshold_); }

    /// Whether the features lie in the box that the model was trained for. NaN does not.
    [[nodiscard]] bool in_domain(const double* features) const noexcept;

private:
    template <class T>
    void evaluate(const Mlp<T>& mlp, const double* features, T* out) const noexcept;

    Model model_;
    std::size_t inputs_;
    std::size_t outputs_;
    double threshold_;
    std::optional<Mlp<float>> single_;  ///< exactly one of the two is set
    std::optional<Mlp<double>> double_;
};

// Certificates: proved statements about a model, as they are stored in its file and used.
//
// A certificate states, for every state in a box and for each of its levels:
//
//     logit < threshold  implies  guard > margin,
//
// except in the boxes that a level lists as unproved. It is made by `learn/certify.hpp`. It
// contains a fingerprint of everything that it depends on (weights, threshold, normalisation,
// domain, recipe, system, parameters) and is void as soon as one of these has changed. The
// fingerprint protects against accidents, not against forgery.

/// One statement of a certificate.
struct CertificateLevel {
    double margin = 0;                                ///< in units of the guard
    double threshold = 0;                             ///< threshold of the logit
    std::uint64_t boxes = 0;                          ///< number of boxes examined
    double seconds = 0;                               ///< [s] time that the proof took
    std::vector<std::vector<ValueRange>> unproved{};  ///< boxes that need the exact guard
};

/// A proof that wherever a network clears, the guard of its system is above a margin.
struct Certificate {
    std::string tool;         ///< "ricochet 0.1.0"
    std::string fingerprint;  ///< of the model
    std::string system;
    std::map<std::string, double> parameters;  ///< of the system
    std::vector<ValueRange> box;               ///< of raw features
    /// Margins increase, thresholds do not; the first threshold is that of the model.
    std::vector<CertificateLevel> levels;
};

/// Hash of everything that a certificate depends on, as 16 hexadecimal digits (FNV-1a, 64 bits).
[[nodiscard]] std::string fingerprint(const Model& model);

/// Text of a certificate as it is stored in a model, one line of JSON; numbers keep their bits.
[[nodiscard]] std::string to_text(const Certificate& certificate);

/// Reads a certificate from its text. @throws std::invalid_argument if it is not one.
[[nodiscard]] Certificate parse_certificate(std::string_view text);

/// Reason why the certificate of `model` does not hold for it, in words that follow "the
/// certificate"; empty if it holds.
/// @throws std::invalid_argument as `parse_certificate`.
[[nodiscard]] std::string why_void(const Model& model);

/// A model together with a certificate that holds for it.
///
/// Immutable, so threads may share it; evaluation allocates nothing.
class CertifiedClassifier {
public:
    /// @throws std::invalid_argument if the model has no certificate, or one that is void or
    /// cannot be read; as `Classifier`.
    explicit CertifiedClassifier(Model model);

    [[nodiscard]] const Classifier& classifier() const noexcept { return classifier_; }
    [[nodiscard]] const Certificate& certificate() const noexcept { return certificate_; }

    /// Whether the guard is proved to be above the first margin at these features. False outside
    /// the box, in an unproved box, and for NaN.
    [[nodiscard]] bool clears(const double* features) const noexcept;

    /// The largest margin above which the guard is proved to be; -inf if there is none.
    [[nodiscard]] double lower_bound(const double* features) const noexcept;

private:
    [[nodiscard]] bool holds(const CertificateLevel& level, double logit,
                             const double* features) const noexcept;

    Certificate certificate_;
    Classifier classifier_;
};

}  // namespace ricochet
