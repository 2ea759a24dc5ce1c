// Statements that a certificate of a model has to prove, for each system whose guard is bounded.
#pragma once

#include <string_view>
#include <vector>

#include "ricochet/learn/certify.hpp"

namespace ricochet::app {

struct GuardProblemOf {
    std::string_view system;
    /// @throws std::invalid_argument if the model does not fit
    learn::GuardProblem (*make)(const Model& model);
};

[[nodiscard]] const std::vector<GuardProblemOf>& guard_problems();

}  // namespace ricochet::app
