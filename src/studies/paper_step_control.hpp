// Parts shared by the two files on the step control paper.
#pragma once

#include <vector>

#include "exhibit.hpp"
#include "ricochet/learn_steps/step_environment.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::app {

/// [s] The steps that an actor takes in an environment, without attempts that had no solution;
/// empty if it does not reach the end.
[[nodiscard]] std::vector<double> lengths_of(const learn::StepEnvironment& runs,
                                             const Model& actor);

[[nodiscard]] Exhibit fault_figure_5(const ExhibitSize& size);
[[nodiscard]] Exhibit fault_figure_6(const ExhibitSize& size);
[[nodiscard]] Exhibit fault_figure_7(const ExhibitSize& size);
[[nodiscard]] Exhibit fault_figure_8(const ExhibitSize& size);
[[nodiscard]] Exhibit fault_figure_9(const ExhibitSize& size);
[[nodiscard]] Exhibit fault_figure_10(const ExhibitSize& size);

}  // namespace ricochet::app
