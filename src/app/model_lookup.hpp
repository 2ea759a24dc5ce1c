// Search for the model that suits a run.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "registry.hpp"
#include "ricochet/nn/model.hpp"
#include "settings.hpp"

namespace ricochet::app {

struct FoundModel {
    std::filesystem::path file;
    Model model;
};

/// Directories with models: beside the program, as ../share/ricochet/models (so in
/// a build and in an installed tree), then under the prefix of the installation.
[[nodiscard]] std::vector<std::filesystem::path> model_directories();

/// The file that the user named: a path, or a name in one of the directories, with
/// or without its extension.
/// @throws BadInput naming the places searched.
[[nodiscard]] std::filesystem::path find_model(const std::string& given);

/// The file of a model that comes with the library, in one of the directories.
/// @throws BadInput naming the places searched.
[[nodiscard]] std::filesystem::path find_model(const OwnModel& own);

/// The model that the user named, see `find_model`.
/// @throws BadInput or ModelError if it does not exist, is no model, or does not suit
///         the system, its parameters or the stepping.
[[nodiscard]] FoundModel named_model(const SystemEntry& system, const RunSettings& settings,
                                     const std::string& given);

/// The gate that the user named: any model for the system and its parameters that is not for a
/// single step, or that has a certificate.
/// @throws BadInput or ModelError, as `named_model`.
[[nodiscard]] FoundModel named_gate(const SystemEntry& system, const RunSettings& settings,
                                    const std::string& given);

/// The values of the system's parameters for which a model was made; parameters on which it does
/// not depend have their defaults.
/// @throws std::invalid_argument for a parameter that the system does not have.
[[nodiscard]] std::vector<double> parameters_of(const SystemEntry& system, const Model& model);

/// The first of the system's own models that suits its parameters, start and
/// stepping.
/// @throws BadInput saying why each does not.
[[nodiscard]] FoundModel suitable_model(const SystemEntry& system, const RunSettings& settings);

}  // namespace ricochet::app
