// What the commands of the system fault share.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ricochet/faults/fault_rupture.hpp"

namespace ricochet::app {

struct Parameter;
struct SystemEntry;
struct CompareRequest;
struct SimulateRequest;

/// From the entry's parameters, in its order.
/// @throws BadInput for a number that is not whole.
[[nodiscard]] StrikeSlipFault::Parameters fault_parameters(
    const std::vector<double>& values, const std::optional<std::filesystem::path>& kernel = {});

/// How many parameters the fault has without those of rate-and-state friction, which follow.
inline constexpr std::size_t weakening_parameters = 14;

/// The mean motion at `n` even times, between the samples that there are.
struct MeanSamples {
    std::vector<double> t, slip, velocity;
};
[[nodiscard]] MeanSamples sampled(const Rupture& rupture, double t_end, std::size_t n);

/// x [km], depth [km], value; rows separated by blank lines, as gnuplot's images want them.
[[nodiscard]] std::string fault_map(const StrikeSlipFault& fault, const Eigen::VectorXd& values);

/// Parameters of rate-and-state friction, whether they ask for it, and a run with it.
[[nodiscard]] std::vector<Parameter> rate_state_parameters();
[[nodiscard]] bool has_rate_and_state(const std::vector<double>& values);
[[nodiscard]] int simulate_rate_state_fault(const SystemEntry& system,
                                            const SimulateRequest& request,
                                            const std::vector<double>& values);
/// @throws BadInput if one of them is set.
void refuse_rate_and_state(const std::vector<std::string>& set, const SystemEntry& system);

/// Explicit and implicit steps on one fault: work, time and true errors.
[[nodiscard]] int compare_fault(const SystemEntry& system, const CompareRequest& request);

}  // namespace ricochet::app
