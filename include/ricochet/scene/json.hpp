// Scenes as JSON text.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

#include "ricochet/scene/scene.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet {

/// Error in the text of a scene. The message is one sentence that begins with file and line:
/// "bin.json:12: expected a number for "radius", found "big"".
class SceneFileError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// A scene and the options of its run, as read from a file.
struct SceneFile {
    Scene scene;
    SceneOptions options;  ///< from "run"; t_end is NaN if it is not given
};

/// Reads the scene that `text` describes (docs/scenes.md lists the keys). Error messages name the
/// text `file`.
/// @throws SceneFileError if `text` is not JSON, or is not a valid scene.
[[nodiscard]] SceneFile read_scene(std::string_view text, std::string_view file = "scene");

/// Reads a scene from a file. @throws SceneFileError also if the file cannot be read.
[[nodiscard]] SceneFile load_scene(const std::string& path);

}  // namespace ricochet
