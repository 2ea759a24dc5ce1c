// Rate-and-state friction on the command line: the spring-slider and the published study.
#pragma once

#include <string_view>

#include "compare.hpp"
#include "registry.hpp"
#include "simulate.hpp"

namespace ricochet::app {

inline constexpr std::string_view spring_slider_name = "spring-slider";
inline constexpr std::string_view rate_and_state_name = "rate-and-state";

/// Its parameters and state; it is run by variational steps, not by the event loop.
[[nodiscard]] const SystemEntry& spring_slider_entry();

/// `ricochet simulate spring-slider`, as `simulate`.
int simulate_spring_slider(const SimulateRequest& request);

/// `ricochet compare rate-and-state`: the tables of the published study beside ours, computed
/// anew in about a minute.
int compare_rate_and_state(const CompareRequest& request);

}  // namespace ricochet::app
