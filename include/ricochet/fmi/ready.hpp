// Ready systems and scenes as FMUs, without a compiler.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ricochet::fmi {

/// A ready system, its values, and the version of its FMU.
struct ReadyFmu {
    std::string_view system;  ///< its name, "bouncing-ball"
    /// Values of parameters, and of components at the start by their titles, in place of those of
    /// the descriptor; with hyphens or underscores.
    std::vector<std::pair<std::string, double>> set{};
    int version = 3;  ///< of FMI: 2 or 3
};

/// Writes an FMU for model exchange and co-simulation: a copy of a library that has all ready
/// systems, and a description. Its start values are those of `set`.
/// @throws fmi::Error with a sentence: for an unknown system or name, for values out of range, and
/// where the library is not installed or the file cannot be written
void export_ready(const ReadyFmu& wanted, const std::filesystem::path& file);

/// A scene in a file, values at its start, and the version of its FMU.
struct SceneFmu {
    std::filesystem::path scene;  ///< a file in JSON
    /// Values of its variables, such as "ball.x", "gravity.y" and "steel.restitution".
    std::vector<std::pair<std::string, double>> set{};
    int version = 3;  ///< of FMI: 2 or 3
};

/// Writes an FMU for co-simulation with the scene inside: a copy of a library that runs scenes.
/// @throws fmi::Error with a sentence: for a scene that is refused, with the line, an unknown
/// variable, and where the library is not installed or a file cannot be read or written
void export_scene(const SceneFmu& wanted, const std::filesystem::path& file);

}  // namespace ricochet::fmi
