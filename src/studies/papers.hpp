// The papers whose tables and figures are repeated here.
#pragma once

#include <vector>

#include "exhibit.hpp"

namespace CLI {
class App;
}

namespace ricochet::app {

[[nodiscard]] Paper event_detection_paper();
[[nodiscard]] Paper step_control_paper();
[[nodiscard]] Paper potentials_paper();

/// `list`, `table` and `figure`.
void add_exhibits(CLI::App& app, int& status);

}  // namespace ricochet::app
