// What the commands of the system fault share.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "ricochet/systems/strike_slip_fault.hpp"

namespace ricochet::app {

struct SystemEntry;
struct CompareRequest;

/// From the entry's parameters, in its order.
/// @throws BadInput for a number that is not whole.
[[nodiscard]] StrikeSlipFault::Parameters fault_parameters(
    const std::vector<double>& values, const std::optional<std::filesystem::path>& kernel = {});

/// Explicit and implicit steps on one fault: work, time and true errors.
[[nodiscard]] int compare_fault(const SystemEntry& system, const CompareRequest& request);

}  // namespace ricochet::app
