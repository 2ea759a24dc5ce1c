// The library's event-driven systems, with loops made for them.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "source.hpp"

namespace ricochet::python {

/// The system of that name; `parameters` are all of its own, in their order.
/// @throws std::invalid_argument for a name that there is not, or parameters outside their range.
[[nodiscard]] std::shared_ptr<Source> ready_system(std::string_view name,
                                                   std::span<const double> parameters);

/// Closed-form results of that system, by the name that their function has in C++.
/// @throws std::invalid_argument for one that there is not.
[[nodiscard]] std::vector<double> closed_form(const Source& system, std::string_view what,
                                              std::span<const double> arguments);

}  // namespace ricochet::python
