// `ricochet train`: a network for one system.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/learn/classifier.hpp"

namespace ricochet::app {

/// Request for a training. Absent values have the library's defaults.
struct TrainingRequest {
    std::string kind;                ///< one of the system's kinds
    std::vector<std::string> set{};  ///< name=value
    std::optional<double> step{};    ///< [s]
    std::optional<std::size_t> states{}, fresh_events{}, iterations{};
    std::optional<std::uint64_t> seed{};
    std::filesystem::path checkpoint{};
    bool resume = false;
};

/// A kind of classifier that can be trained for a system.
struct TrainingKind {
    std::string_view name;
    std::string_view other_name;
    std::string_view meaning;
};

struct TrainRequest {
    std::string system{};
    TrainingRequest training{};  ///< an empty kind is the system's first
    std::filesystem::path out{};
    bool allow_misses = false;
    bool json = false;
};

/// The networks of the bouncing ball; the first kind is the default.
[[nodiscard]] const std::vector<TrainingKind>& ball_kinds();

/// Trains one of them.
/// @throws BadInput for options that this training does not have; as `learn::train_bouncing_ball`.
[[nodiscard]] learn::Trained train_ball(const TrainingRequest& request,
                                        const learn::ProgressCallback& progress);

/// Trains, shows progress on standard error, prints the report and writes the
/// model. Ctrl-C stops the training and keeps the best so far; a checkpoint beside
/// the model, or at the requested place, lets it be resumed.
///
/// @return 0 if the training ran to its end and the model was written, else 1.
/// @throws BadInput, ModelError, std::invalid_argument or std::runtime_error.
int train(const TrainRequest& request);

}  // namespace ricochet::app
