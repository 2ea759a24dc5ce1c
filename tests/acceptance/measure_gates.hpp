// Savings and misses of trained gates.
#pragma once

#include <cstddef>

#include "measure.hpp"

namespace ricochet::bench {

/// A boolean black box on an arm of 4 joints among 8 obstacles, in calls of the guard: a horizon
/// gate, trained here, against a check of every step and against `EveryK`, over at least
/// `events` fresh events each.
[[nodiscard]] Measured gate_black_box_4(std::size_t events = 30'000);

/// The same with 6 joints among 40 obstacles. Reported, no target.
[[nodiscard]] Measured gate_black_box_6(std::size_t events = 30'000);

/// A smallest eigenvalue: a level gate in the planner, calibrated, against the planner alone, in
/// calls of the guard over `seconds` of the motion.
[[nodiscard]] Measured gate_eigenvalue(double level, double seconds = 300);

/// A valued guard without a known bound, on the arm of 4 joints: `SlopeSkip`, `EveryK` and a
/// horizon gate, with the misses of each.
[[nodiscard]] Measured gate_without_bounds(std::size_t events = 30'000);

}  // namespace ricochet::bench
