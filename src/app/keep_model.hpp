// Safe storage of models that took long to make.
#pragma once

#include <filesystem>
#include <string>

#include "ricochet/nn/model.hpp"

namespace ricochet::app {

/// Writes the model to `file`; where that fails, as on a full disk, to a new file beside it or in
/// the directory for temporary files.
/// @throws WriteError saying where the model is instead; or, if it is nowhere, that `checkpoint`,
///         if there is one, keeps the training.
void keep_model(const Model& model, const std::filesystem::path& file,
                const std::filesystem::path& checkpoint);

/// Claims the files of a training; an empty checkpoint becomes the one beside the model.
/// @throws BadInput if they cannot be used in these roles.
void claim_training(const std::filesystem::path& out, std::filesystem::path& checkpoint,
                    bool resume);

/// Prints on standard error from which checkpoint an interrupted command continues.
/// @param trouble  why its last checkpoint could not be written; empty if it was
void say_what_is_kept(const std::filesystem::path& checkpoint, const std::string& trouble);

}  // namespace ricochet::app
