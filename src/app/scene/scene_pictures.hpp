// Pictures of a scene that has run, from its samples.
#pragma once

#include <filesystem>
#include <string>

#include "ricochet/scene/json.hpp"

namespace ricochet::app {

/// Ways of the bodies, where they end, surfaces, and where bodies were struck; drawn by gnuplot.
/// @throws WriteError as `plot` does
void plot_scene(const SceneFile& file, const SceneRun& run, const std::filesystem::path& picture);

/// The motion as one SVG that a browser plays again and again, in the time of the scene. Positions
/// are kept to half a pixel, and what does not move costs nothing.
[[nodiscard]] std::string animated_scene(const SceneFile& file, const SceneRun& run);

}  // namespace ricochet::app
