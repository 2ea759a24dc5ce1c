// `ricochet ensemble`: a run of a system for every row of a table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "../settings.hpp"

namespace ricochet::app {

struct EnsembleRequest {
    std::string system{};
    RunRequest run{};
    std::optional<std::filesystem::path> table{};
    std::optional<std::size_t> count{};  ///< of random rows
    std::vector<std::string> vary{};     ///< name=lowest:highest
    std::optional<std::uint64_t> seed{};
    std::optional<std::filesystem::path> out{};
    std::optional<std::string> share{};  ///< k/n
    std::optional<std::filesystem::path> merge{};
    std::optional<unsigned> threads{};
    bool json = false;

    friend bool operator==(const EnsembleRequest&, const EnsembleRequest&) = default;
};

/// Runs the rows of this process's share that are not kept yet, and prints how they ended; the only
/// share writes the results, too. With `merge` nothing is run, and the results are written from the
/// shares.
///
/// Ctrl-C and a request to terminate end it between blocks of rows; the same call goes on.
///
/// @return 0 if every row of the share has been run, however its run ended; 129, 130 or 143 if a
///         signal ended it
/// @throws BadInput, ModelError, WriteError
int run_ensemble(const EnsembleRequest& request);

}  // namespace ricochet::app
