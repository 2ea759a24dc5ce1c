// Runs of `FrictionInclusion`, compiled once for the systems that it describes.
#pragma once

#include "../registry.hpp"
#include "ricochet/systems/friction_inclusion.hpp"

namespace ricochet::app {

[[nodiscard]] TimedRun run_friction(const FrictionInclusion& system,
                                    const FrictionInclusion::Vector& w0,
                                    const RunSettings& settings, int repeats);

/// The same with the modes of `FrictionOscillator`, and one more for set-valued steps.
[[nodiscard]] TimedRun run_oscillator(const FrictionInclusion& system,
                                      const FrictionInclusion::Vector& w0,
                                      const RunSettings& settings, int repeats);

}  // namespace ricochet::app
