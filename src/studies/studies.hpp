// Comparisons that take a minute and more: `ricochet compare` of these names runs the program
// ricochet-studies.
#pragma once

#include <functional>

#include "compare.hpp"

namespace ricochet::app {

/// [s] The shortest of up to five repetitions, which end early once they have taken `enough` [s].
[[nodiscard]] double seconds_of(const std::function<void()>& work, double enough);

/// `compare step-control`: rules that choose steps, at equal true error. Prints for every rule the
/// coarsest setting from which on its error stays below the target, and the work that it takes.
/// @return 0 if every rule reached the target, else 1.
/// @throws BadInput or ModelError.
int compare_step_control(const CompareRequest& request);

/// `compare rate-and-state`: the tables of the published study beside ours, computed again in about
/// a minute.
int compare_rate_and_state(const CompareRequest& request);

/// `compare fault`: explicit and implicit steps on one fault: work, time and true errors.
int compare_fault(const CompareRequest& request);

}  // namespace ricochet::app
