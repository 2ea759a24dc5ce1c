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
    std::optional<std::string> phase{};             ///< two components, for `plot`: "u,v"
    std::optional<std::filesystem::path> kernel{};  ///< for the system fault
};

class Claims;

/// Claims the requested files, `csv` and `plot`.
/// @throws BadInput if they cannot be written.
void claim_results(Claims& claims, const SimulateRequest& request);

/// Prints the run, and writes the requested files.
///
/// Ctrl-C, a request to terminate and memory that runs short end the run; the results until
/// then are printed and written, marked as incomplete.
///
/// @return 0 if the run reached its end; 129, 130 or 143 if a signal ended it; 1 if it ended
///         otherwise (the result is printed and written all the same) or if the plot could not
///         be drawn.
/// @throws BadInput or ModelError before anything is printed or written.
int simulate(const SimulateRequest& request);

}  // namespace ricochet::app
