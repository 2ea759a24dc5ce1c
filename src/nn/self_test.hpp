// The test evaluation in a model file, which is repeated when the file is read.
#pragma once

#include "ricochet/nn/guard_network.hpp"
#include "ricochet/nn/mlp.hpp"
#include "safetensors_header.hpp"

#include <cstddef>
#include <optional>

namespace ricochet::model_file {

/// The network of a model that has been checked: of a guard one that takes any activation.
class Outputs {
public:
    /// An error of the network, such as a layer that is too wide, is reported with the name of the
    /// file.
    Outputs(const Model& model, const Refusal& refuse);

    [[nodiscard]] std::size_t inputs() const noexcept;
    [[nodiscard]] std::size_t outputs() const noexcept;
    /// Reads `inputs()` features, writes `outputs()` numbers.
    void evaluate(const double* features, double* out) const noexcept;

private:
    std::optional<Classifier> classifier_;  ///< exactly one of the two is set
    std::optional<GuardNetwork> guard_;
};

/// Refuses a model that does not give the output of its self-test.
void repeat_self_test(const Model& model, const Refusal& refuse);

/// Makes a self-test at a point inside the domain. It is off the centre, where normalised features
/// may all be zero, and at a different fraction of each feature, so that exchanged features are
/// noticed.
[[nodiscard]] SelfTest make_self_test(const Model& model, const Refusal& refuse);

}  // namespace ricochet::model_file
