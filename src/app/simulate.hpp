// `ricochet simulate`: one run of one system.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "settings.hpp"

namespace ricochet::app {

struct SimulateRequest {
    std::string system{};
    RunRequest run{};
    std::optional<std::size_t> samples{};
    bool json = false;
    std::optional<std::filesystem::path> csv{}, plot{};
    std::optional<std::filesystem::path> kernel{};  ///< of the system fault
};

/// Prints the run, and writes the files asked for.
///
/// @return 0 if the run reached its end; 1 if it ended otherwise (the result is
///         printed and written all the same) or if the plot could not be drawn.
/// @throws BadInput or ModelError before anything is printed or written.
int simulate(const SimulateRequest& request);

}  // namespace ricochet::app
