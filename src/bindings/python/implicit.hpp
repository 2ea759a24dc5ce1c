// Doors of runs by Rosenbrock's method.
#pragma once

#include <memory>
#include <vector>

#include "formula.hpp"
#include "source.hpp"

namespace ricochet::python {

/// A door for any system: its Jacobian is the caller's, else made of differences.
[[nodiscard]] std::unique_ptr<RunDoor> implicit_door(std::unique_ptr<RunDoor> callbacks,
                                                     const State& x0);

/// A door for formulas, of which the Jacobian is exact.
/// @param callbacks  a door to the same system, for its resets and further functions
[[nodiscard]] std::unique_ptr<RunDoor> implicit_formula_door(
    std::unique_ptr<RunDoor> callbacks, const ModedFormula& flow,
    std::vector<const ModedFormula*> guards, const State& x0);

}  // namespace ricochet::python
