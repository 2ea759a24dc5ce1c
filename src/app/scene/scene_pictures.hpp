// Pictures of a scene that has run, from its samples.
#pragma once

#include <filesystem>
#include <string>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::app {

/// Paths and ends of the bodies, surfaces, and places of impacts; drawn by gnuplot.
/// @throws WriteError as `plot` does
void plot_scene(const SceneFile& file, const SceneRun& run, const std::filesystem::path& picture);

/// The motion as one SVG that a browser plays repeatedly, in the time of the scene. Positions
/// are accurate to half a pixel, and fixed parts cost nothing.
[[nodiscard]] std::string animated_scene(const SceneFile& file, const SceneRun& run);

}  // namespace ricochet::app
