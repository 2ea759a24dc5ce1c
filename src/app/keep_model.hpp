// Models that took long to make.
#pragma once

#include <filesystem>
#include <string>

#include "ricochet/nn/model.hpp"

namespace ricochet::app {

/// Writes the model to `file`; where that fails, as on a full disk, to a new file beside it or in
/// the directory for temporary files.
/// @throws WriteError saying where the model is instead; or, if it is nowhere, that `checkpoint`
///         keeps the training, where there is one.
void keep_model(const Model& model, const std::filesystem::path& file,
                const std::filesystem::path& checkpoint);

/// The files of a training; an empty checkpoint becomes the one beside the model.
/// @throws BadInput if they cannot be what they are to be.
void claim_training(const std::filesystem::path& out, std::filesystem::path& checkpoint,
                    bool resume);

/// Says on standard error where an interrupted command continues from.
/// @param trouble  why its last checkpoint could not be written; empty: it was
void say_what_is_kept(const std::filesystem::path& checkpoint, const std::string& trouble);

}  // namespace ricochet::app
