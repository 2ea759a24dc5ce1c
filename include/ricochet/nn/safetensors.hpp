// Models in files: the safetensors format, with provenance in its metadata.
//
// Eight bytes give the length of a JSON header, little-endian; the header gives
// type, shape and place of each tensor; the rest of the file is the tensors.
//
//     layers.<k>.weight   outputs x inputs, F32 or F64, k = 0, 1, ...
//     layers.<k>.bias     outputs
//     __metadata__        strings; numbers in decimal, lists separated by spaces
//         ricochet           "1", the version of this list
//         kind               "event-classifier", "gate-horizon", "gate-level" or "step-policy"
//         system             name
//         parameters         name=value ...
//         recipe             name of what is computed from (t, x, h)
//         offset, scale      one number per feature
//         domain             lower and upper per feature
//         activation         "relu" or "tanh"
//         threshold          number
//         step_range         smallest and largest step [s]
//         seed               integer
//         self_test_input    raw features
//         self_test_output   what the model makes of them
//         certificate        optional
//         levels             of a gate: value and threshold of each
//         calibration        of a gate, optional: events, misses, bound, steps, seed
//
// A file is untrusted: whatever does not fit is refused, in one sentence.
#pragma once

#include "ricochet/nn/model.hpp"

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet {

/// A model file that cannot be read, written or believed. The message names file,
/// tensor or metadata entry, what was expected and what was found.
class ModelError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Options of `load_model`.
struct LoadOptions {
    bool allow_non_finite = false;  ///< accept NaN and infinite weights
};

/// @throws ModelError if the file cannot be read or does not fit.
[[nodiscard]] Model load_model(const std::string& path, const LoadOptions& options = {});

/// The model in the bytes of a file; `name` stands for the file in messages.
/// @throws ModelError if they do not fit.
[[nodiscard]] Model parse_model(std::span<const std::byte> bytes, std::string_view name,
                                const LoadOptions& options = {});

/// The bytes of a file. Numbers keep their bits, but for weights of an f32 model,
/// which are rounded to float. An empty self-test is filled in, at the middle of
/// the domain. The options say what a later load will accept.
/// @throws ModelError if the bytes would be refused by it.
[[nodiscard]] std::vector<std::byte> to_safetensors(const Model& model,
                                                    const LoadOptions& options = {});

/// Writes beside `path` and renames, so that a file of that name is complete or as
/// it was, and nothing else is left behind.
/// @throws ModelError if the file cannot be written, or as `to_safetensors`.
void save_model(const Model& model, const std::string& path, const LoadOptions& options = {});

}  // namespace ricochet
