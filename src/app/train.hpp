// `ricochet train`: a network for one system.
#pragma once

#include <filesystem>
#include <string>

#include "registry.hpp"

namespace ricochet::app {

struct TrainRequest {
    std::string system{};
    TrainingRequest training{};  ///< an empty kind is the system's first
    std::filesystem::path out{};
    bool allow_misses = false;
    bool json = false;
};

/// The files of a training; an empty checkpoint becomes the one beside the model.
/// @throws BadInput if they cannot be what they are to be.
void claim_training(const std::filesystem::path& out, std::filesystem::path& checkpoint,
                    bool resume);

/// Of what was interrupted: where it goes on from, on standard error.
/// @param trouble  why its last checkpoint could not be written; empty: it was
void say_what_is_kept(const std::filesystem::path& checkpoint, const std::string& trouble);

/// Trains, shows progress on standard error, prints the report and writes the
/// model. Ctrl-C stops the training and keeps the best so far; a checkpoint beside
/// the model, or where the request says, lets it be resumed.
///
/// @return 0 if the training ran to its end and the model was written, else 1.
/// @throws BadInput, ModelError, std::invalid_argument or std::runtime_error.
int train(const TrainRequest& request);

}  // namespace ricochet::app
