// Reports on a run: as text, as JSON, and as rows of numbers.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "registry.hpp"

namespace ricochet::app {

/// One state in the order of time; at an event there are two.
struct Row {
    double t = 0;  ///< [s]
    std::vector<double> x;
    std::string event{};  ///< empty, "before floor" or "after floor"
};

/// The sampled trajectory with the left and right limits at each event, and the
/// end of the run.
[[nodiscard]] std::vector<Row> rows(const SystemEntry& system, const Run<std::vector<double>>& run);

/// "bouncing-ball: gravity 9.81 m/s², restitution 0.9, ..."
[[nodiscard]] std::string title(const SystemEntry& system, const RunSettings& settings);

/// The run as a JSON object; numbers round-trip, those that are not finite are null.
/// @param with_trajectory  the samples too
[[nodiscard]] std::string to_json(const SystemEntry& system, const RunSettings& settings,
                                  const TimedRun& timed, bool with_trajectory);

/// The run as a table for people.
[[nodiscard]] std::string to_text(const SystemEntry& system, const RunSettings& settings,
                                  const TimedRun& timed);

/// Header "t [s],u [m],...,event", then `rows`.
[[nodiscard]] std::string to_csv(const SystemEntry& system, const Run<std::vector<double>>& run);

/// Prints on standard error that a result is incomplete because the command was ended early, and
/// `where` it ended; returns the exit status.
[[nodiscard]] int ended_early(std::string_view where);

/// The same for a table of numbers: a comment, to be its last line.
[[nodiscard]] std::string incomplete_line();

/// Prints to standard output.
/// @throws WriteError if it cannot.
void print(std::string_view text);

}  // namespace ricochet::app
