// The library's event-driven systems, with loops made for them.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "source.hpp"

namespace ricochet::python {

/// The system with the given name; `parameters` are all its parameters, in their order.
/// @throws std::invalid_argument for an unknown name, or parameters outside their range.
[[nodiscard]] std::shared_ptr<Source> ready_system(std::string_view name,
                                                   std::span<const double> parameters);

/// Closed-form result of the system, by the name of its function in C++.
/// @throws std::invalid_argument for an unknown name.
[[nodiscard]] std::vector<double> closed_form(const Source& system, std::string_view what,
                                              std::span<const double> arguments);

}  // namespace ricochet::python
