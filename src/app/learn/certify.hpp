// `ricochet certify`: a proof that wherever a model clears, its guard is above a margin.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

namespace ricochet::app {

struct CertifyRequest {
    std::string model{};  ///< path, or name in one of the model directories
    std::optional<double> margin{}, ratio{}, limit{}, time_limit{}, smallest{};
    std::optional<std::size_t> levels{}, threads{}, max_unproved{};
    bool keep_threshold = false;
    std::filesystem::path out{};         ///< empty: the model's own file
    std::filesystem::path checkpoint{};  ///< empty: beside it
    bool resume = false;
    bool json = false;
};

/// Prints the estimate and the progress on standard error, then the result, and writes the
/// model with its certificate. Ctrl-C and the time limit leave a checkpoint to resume from; the
/// levels finished by then are written.
///
/// @return 0 if all levels were proved, perhaps with unproved boxes listed, else 1.
/// @throws BadInput also if the estimate is above the limit; ModelError, std::invalid_argument.
int certify(const CertifyRequest& request);

}  // namespace ricochet::app
