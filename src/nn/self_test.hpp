// The test evaluation in a model file, which is repeated when the file is read.
#pragma once

#include "ricochet/nn/mlp.hpp"
#include "safetensors_header.hpp"

namespace ricochet::model_file {

/// Makes a classifier of a model that has been checked. An error of the classifier, such as a layer
/// that is too wide, is reported with the name of the file.
[[nodiscard]] Classifier classifier_of(const Model& model, const Refusal& refuse);

/// Refuses a model that does not give the output of its self-test.
void repeat_self_test(const Model& model, const Refusal& refuse);

/// Makes a self-test at a point inside the domain. It is off the centre, where normalised features
/// may all be zero, and at a different fraction of each feature, so that exchanged features are
/// noticed.
[[nodiscard]] SelfTest make_self_test(const Model& model, const Refusal& refuse);

}  // namespace ricochet::model_file
