// Scenes whose guards are bounded, from the parameters of their entries, in their order.
#pragma once

#include <vector>

#include "problems/cavern.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/planar_arm.hpp"

namespace ricochet::app {

using Arm = PlanarArm<4>;

[[nodiscard]] Cavern cavern_of(const std::vector<double>& parameters);
[[nodiscard]] Arm arm_of(const std::vector<double>& parameters);
[[nodiscard]] LeastEigenvalue eigenvalue_of(const std::vector<double>& parameters);

}  // namespace ricochet::app
