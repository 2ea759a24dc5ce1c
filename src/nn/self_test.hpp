// The one evaluation that a model file carries, and repeats when it is read.
#pragma once

#include "ricochet/detail/classifier.hpp"
#include "safetensors_header.hpp"

namespace ricochet::model_file {

/// Classifiers are made of models that have been checked; what they still refuse, such as a layer
/// too wide, is refused in the name of the file.
[[nodiscard]] Classifier classifier_of(const Model& model, const Refusal& refuse);

/// Refuses a model that does not give the output of its self-test.
void repeat_self_test(const Model& model, const Refusal& refuse);

/// A point inside the domain, off its middle, where normalised features may all be zero, and at
/// another fraction for each feature, so that no two can be exchanged unnoticed.
[[nodiscard]] SelfTest make_self_test(const Model& model, const Refusal& refuse);

}  // namespace ricochet::model_file
