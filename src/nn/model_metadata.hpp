// Metadata of a model file, as text of the header.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "safetensors_header.hpp"

namespace ricochet::model_file {

inline constexpr std::string_view format_version = "1";

/// Refuses a file of another version of the format.
void check_version(const Header& header, const Refusal& refuse);

/// Reads the metadata of a model whose layers have been read.
void read_metadata(const Header& header, const Refusal& refuse, Model& model);

/// Metadata for a file of `model`.
[[nodiscard]] std::map<std::string, std::string> metadata_of(const Model& model,
                                                             const SelfTest& self_test,
                                                             const Refusal& refuse);

}  // namespace ricochet::model_file
