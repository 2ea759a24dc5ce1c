// `ricochet ensemble`: a run of a system for every row of a table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "../settings.hpp"
#include "share.hpp"

namespace CLI {
class App;
}

namespace ricochet::app {

struct EnsembleRequest {
    std::string system{};
    RunRequest run{};
    std::optional<std::filesystem::path> table{};
    std::optional<std::size_t> count{};   ///< of random rows
    std::vector<std::string> vary{};      ///< name=lowest:highest, see `made_table`
    std::vector<std::string> grid{};      ///< name=first:last:count
    std::optional<std::size_t> events{};  ///< number of the first events whose times are results
    std::optional<std::uint64_t> seed{};
    std::optional<std::filesystem::path> out{};
    std::optional<std::string> share{};  ///< k/n
    std::optional<std::filesystem::path> merge{};
    std::optional<unsigned> threads{};
    std::optional<std::filesystem::path> plot{};
    std::vector<std::string> show{};  ///< results in the plot
    bool json = false;

    friend bool operator==(const EnsembleRequest&, const EnsembleRequest&) = default;
};

/// Runs the rows of this process's share that are not kept yet, and prints how they ended; if it is
/// the only share, it writes the results, too. With `merge` nothing is run, and the results are
/// written from the shares.
///
/// Ctrl-C and a request to terminate end it between blocks of rows; the same call continues it.
///
/// @return 0 if every row of the share has been run, whatever the outcome of its run; 129, 130 or
///         143 if a signal ended it
/// @throws BadInput, ModelError, WriteError
int run_ensemble(const EnsembleRequest& request);

using EnsembleHandler = int (*)(const EnsembleRequest& request);

/// Adds the command with all its options; it sets the exit status when it is run.
void add_ensemble(CLI::App& app, int& status, EnsembleHandler handler);

/// Processes that share the blocks as they become free, in place of fixed shares.
struct BlockDealer {
    Share place;                         ///< the file of this process
    std::function<std::size_t()> next;   ///< 0, 1, 2, ..., each to only one process
    std::function<void()> wait_for_all;  ///< until all processes have called it
};

/// The same with a dealer; the first process writes the results and prints.
int run_ensemble_dealt(const EnsembleRequest& request, const BlockDealer& dealer);

}  // namespace ricochet::app
