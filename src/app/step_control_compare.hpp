// `ricochet compare step-control`: rules that choose steps, at equal true error.
#pragma once

#include <optional>
#include <string>

#include "compare.hpp"

namespace ricochet::app {

inline constexpr std::string_view step_control_name = "step-control";

/// Prints for every rule the coarsest setting from which on its error stays below the target, and
/// what that takes. `system`: of those with policies, or all of them if empty.
/// @return 0 if every rule got there, else 1.
/// @throws BadInput or ModelError.
int compare_step_control(const CompareRequest& request, const std::string& system);

}  // namespace ricochet::app
