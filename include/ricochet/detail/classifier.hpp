// Internal: the declarations of this header may change without notice.
//
// A model that is ready to predict whether a step meets an event.
#pragma once

#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"

#include <cstddef>
#include <optional>

namespace ricochet {

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

}  // namespace ricochet
