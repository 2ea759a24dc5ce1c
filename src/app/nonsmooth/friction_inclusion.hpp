// Runs of `FrictionInclusion`, compiled once for the systems that it describes.
#pragma once

#include "../registry.hpp"
#include "ricochet/systems/friction_inclusion.hpp"

namespace ricochet::app {

[[nodiscard]] TimedRun run_friction(const FrictionInclusion& system,
                                    const FrictionInclusion::Vector& w0,
                                    const RunSettings& settings, int repeats);

/// The same in the modes of `FrictionOscillator`; set-valued steps are one more.
[[nodiscard]] TimedRun run_oscillator(const FrictionInclusion& system,
                                      const FrictionInclusion::Vector& w0,
                                      const RunSettings& settings, int repeats);

/// The modes of `FrictionOscillator`, and the one more.
[[nodiscard]] std::vector<std::string_view> with_set_valued(std::vector<std::string_view> modes);

}  // namespace ricochet::app
