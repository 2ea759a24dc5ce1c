// The fault and the spring-slider on the command line.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::app {

struct SystemEntry;
struct SimulateRequest;

/// Parameters from those of the entry, in its order.
/// @throws BadInput for a number that is not whole.
[[nodiscard]] StrikeSlipFault::Parameters fault_parameters(
    const std::vector<double>& values, const std::optional<std::filesystem::path>& kernel = {});

/// Number of parameters of the fault without those of rate-and-state friction, which follow.
inline constexpr std::size_t weakening_parameters = 14;

/// The mean motion at `n` even times, interpolated between the samples.
struct MeanSamples {
    std::vector<double> t, slip, velocity;
};
[[nodiscard]] MeanSamples sampled(const Rupture& rupture, double t_end, std::size_t n);

/// x [km], depth [km], value; rows separated by blank lines, as gnuplot's images require.
[[nodiscard]] std::string fault_map(const StrikeSlipFault& fault, const Eigen::VectorXd& values);

/// Whether a parameter is among the assignments "name=value".
[[nodiscard]] bool given(const std::vector<std::string>& set, std::string_view name);

/// @throws BadInput unless the value of this parameter is a whole number.
double whole(std::string_view name, double value);

/// Whether these parameters choose rate-and-state friction.
[[nodiscard]] bool has_rate_and_state(const std::vector<double>& values);

/// @throws BadInput if a parameter of rate-and-state friction is set.
void refuse_rate_and_state(const std::vector<std::string>& set, const SystemEntry& system);

/// `ricochet simulate` for the systems of the program ricochet-fault; as `simulate`.
[[nodiscard]] int simulate_fault(const SystemEntry& system, const SimulateRequest& request);
[[nodiscard]] int simulate_rate_state_fault(const SystemEntry& system,
                                            const SimulateRequest& request,
                                            const std::vector<double>& values);
[[nodiscard]] int simulate_spring_slider(const SystemEntry& system, const SimulateRequest& request);

}  // namespace ricochet::app
