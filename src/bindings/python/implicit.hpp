// SystemAdapters of runs by Rosenbrock's method.
#pragma once

#include <memory>

#include "formula_series.hpp"
#include "source.hpp"

namespace ricochet::python {

/// A adapter for any system: its Jacobian is the caller's, else made of differences.
[[nodiscard]] std::unique_ptr<RunAdapter> implicit_adapter(std::unique_ptr<RunAdapter> callbacks,
                                                           const State& x0);

/// A adapter for formulas, of which the Jacobian is exact.
/// @param callbacks  a adapter to the same system, for its resets and further functions
[[nodiscard]] std::unique_ptr<RunAdapter> implicit_formula_adapter(
    std::unique_ptr<RunAdapter> callbacks, std::shared_ptr<const FormulaSeries> series,
    const State& x0);

}  // namespace ricochet::python
