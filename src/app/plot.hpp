// Plots of a run, drawn by gnuplot.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "registry.hpp"
#include "simulate.hpp"

namespace ricochet::app {

/// @throws BadInput unless `file` ends in .svg or .png.
void check_plot(const std::filesystem::path& file);

/// Components of the state along the axes of a phase plane.
struct PhasePlane {
    std::size_t across, up;
};

/// The plane of `--phase`, nothing without it.
/// @throws BadInput unless it names two components of the state, and `--plot` is given.
[[nodiscard]] std::optional<PhasePlane> phase_plane(const SystemEntry& system,
                                                    const SimulateRequest& request);

/// Draws every component of the state against time, or two of them in their plane, broken at the
/// events, which are marked. gnuplot runs as a child process, without a shell, in a temporary
/// directory; nothing the user typed becomes part of its script.
///
/// @throws WriteError if there is no gnuplot (saying how to get it), or it fails.
void plot(const SystemEntry& system, const RunSettings& settings,
          const Run<std::vector<double>>& run, const std::filesystem::path& file,
          const std::optional<PhasePlane>& plane = {});

/// A text in gnuplot's single quotes, in which only the quote is special.
[[nodiscard]] std::string single_quoted(std::string_view text);

/// Names and contents of the files that a script reads.
using PlotFiles = std::vector<std::pair<std::string, std::string>>;

/// The prelude of every script for gnuplot: terminal by the ending of `file`, size in pixels, and
/// one style for lines, points, grid and palette. Curves use `linestyle` 1 to 6, events 12.
[[nodiscard]] std::string plot_head(const std::filesystem::path& file, int width, int height);

/// Runs gnuplot, as `plot` does, on our own script among `files`.
/// @throws WriteError as `plot` does.
void draw(const PlotFiles& files, const std::string& script, const std::filesystem::path& file);

}  // namespace ricochet::app
