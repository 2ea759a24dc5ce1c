// Models that took long to make.
#pragma once

#include <filesystem>

#include "ricochet/nn/model.hpp"

namespace ricochet::app {

/// Writes the model to `file`; where that fails, as on a full disk, to a new file beside it or in
/// the directory for temporary files.
/// @throws WriteError saying where the model is instead; or, if it is nowhere, that `checkpoint`
///         keeps the training, where there is one.
void keep_model(const Model& model, const std::filesystem::path& file,
                const std::filesystem::path& checkpoint);

}  // namespace ricochet::app
