// JSON as the command line prints it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace ricochet::app {

using Json = nlohmann::ordered_json;

/// Indented, with a line end. Numbers round-trip, those that are not finite are
/// null; bytes that are not UTF-8, as a file name may hold, are replaced.
[[nodiscard]] std::string json_text(const Json& json);

}  // namespace ricochet::app
