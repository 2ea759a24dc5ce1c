// A trained network, as exposed to Python.
#pragma once

#include <memory>
#include <optional>

#include "ricochet/gate.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::python {

/// Immutable, so that threads may share it.
class PyNetwork {
public:
    /// @throws std::invalid_argument if the layers do not fit together, or as `gates::Gate`.
    explicit PyNetwork(Model model);

    [[nodiscard]] std::shared_ptr<const Model> model() const { return model_; }
    [[nodiscard]] const Classifier& classifier() const noexcept { return classifier_; }
    /// The gate; null if the model is not a gate.
    [[nodiscard]] const gates::Gate* gate() const noexcept { return gate_ ? &*gate_ : nullptr; }
    /// The certified classifier; null if the model has no certificate that holds.
    [[nodiscard]] const CertifiedClassifier* certified() const noexcept
    {
        return certified_ ? &*certified_ : nullptr;
    }

private:
    std::shared_ptr<const Model> model_;
    Classifier classifier_;
    std::optional<gates::Gate> gate_;
    std::optional<CertifiedClassifier> certified_;
};

}  // namespace ricochet::python
