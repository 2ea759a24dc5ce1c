// The library's event-driven systems, with loops made for them.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/systems/descriptor.hpp"
#include "source.hpp"

namespace ricochet::python {

/// The system with the given name; `parameters` are all its parameters, in their order.
/// @throws std::invalid_argument for an unknown name, or parameters outside their range.
[[nodiscard]] std::shared_ptr<Source> ready_system(std::string_view name,
                                                   std::span<const double> parameters);

/// A function of the known motion of a ready system.
/// @throws std::invalid_argument for an unknown name, and arguments that do not fit.
[[nodiscard]] std::vector<double> closed_form(std::string_view system, std::string_view function,
                                              std::span<const double> parameters,
                                              std::span<const double> arguments);

/// What a ready system says of itself, and the names of its modes, if it has several.
struct ReadyDescription {
    const SystemDescriptor* system;
    std::vector<std::string> modes;
};
[[nodiscard]] std::vector<ReadyDescription> ready_descriptions();

}  // namespace ricochet::python
