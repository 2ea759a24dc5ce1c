// Plots of a run, drawn by gnuplot.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "registry.hpp"

namespace ricochet::app {

/// @throws BadInput unless `file` ends in .svg or .png.
void check_plot(const std::filesystem::path& file);

/// Draws every component of the state against time, broken at the events, which
/// are marked. gnuplot runs as a child process, without a shell, in a temporary
/// directory; nothing the user typed becomes part of its script.
///
/// @throws WriteError if there is no gnuplot (saying how to get it), or it fails.
void plot(const SystemEntry& system, const RunSettings& settings,
          const Run<std::vector<double>>& run, const std::filesystem::path& file);

/// Names and contents of the files that a script reads.
using PlotFiles = std::vector<std::pair<std::string, std::string>>;

/// The prelude of every script for gnuplot: terminal by the ending of `file`, size in pixels, and
/// one style for lines, points, grid and palette. Curves use `linestyle` 1 to 6, events 12.
[[nodiscard]] std::string plot_head(const std::filesystem::path& file, int width, int height);

/// Runs gnuplot, as `plot` does, on our own script among `files`.
/// @throws WriteError as `plot` does.
void draw(const PlotFiles& files, const std::string& script, const std::filesystem::path& file);

}  // namespace ricochet::app
