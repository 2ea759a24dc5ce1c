// A trained network as it is stored: its layers, and the problem that it was trained for.
//
// Plain data. The functions below read and write it, `nn/mlp.hpp` evaluates
// it, `learn/` trains it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet {

/// Activation after every hidden layer; the last layer is linear. Networks other than guards have
/// one of the first two.
enum class Activation {
    relu,
    tanh,
    softplus,  ///< log(1 + exp(x))
    silu,      ///< x / (1 + exp(-x))
    sine,
};

/// Name of an activation as model files spell it: "relu", "tanh", "softplus", "silu" or "sin".
[[nodiscard]] std::string_view name(Activation activation) noexcept;

/// Type in which the weights are stored, and in whose arithmetic they are evaluated.
enum class Precision { f32, f64 };

/// y = weight x + bias.
struct DenseLayer {
    std::size_t inputs = 0;
    std::size_t outputs = 0;
    std::vector<double> weight;  ///< outputs x inputs, row by row
    std::vector<double> bias;    ///< outputs
};

/// A closed range; the domain of a model is one per feature.
struct ValueRange {
    double lower = 0;
    double upper = 0;
};

/// A recorded evaluation, repeated whenever the model is loaded.
struct SelfTest {
    std::vector<double> input;   ///< raw features, before offset and scale
    std::vector<double> output;  ///< logits
};

/// One decision of a gate.
///
///     horizon   output k below `threshold`: no event within `value` [s]
///     level     the one output below `threshold`: the guard is above `value`
///
/// Values increase; the thresholds of a level gate do not increase.
struct GateLevel {
    double value = 0;
    double threshold = 0;
};

/// Behaviour of a gate on runs from which it was not made.
struct Calibration {
    std::uint64_t events = 0;  ///< number of events in the runs; 0: there were no runs
    std::uint64_t misses = 0;  ///< of these, events that a gated run did not find
    double miss_bound = 1;     ///< bound on the fraction missed, at 95 % confidence
    std::uint64_t steps = 0;   ///< number of steps of the runs
    std::uint64_t seed = 0;    ///< seed of the runs
};

/// A multilayer perceptron and its provenance.
///
///     y = mlp((features - offset) * scale)
///
/// with `features` computed from (t, x, h) by the recipe of that name.
struct Model {
    /// Kind of the model; also "guard", "gate-horizon", "gate-level", "step-policy", "step-actor".
    std::string kind = "event-classifier";
    std::string system;                        ///< e.g. "bouncing-ball"
    std::map<std::string, double> parameters;  ///< of the system, those the model depends on
    std::string recipe;                        ///< e.g. "state"
    std::vector<double> offset;                ///< one per feature
    std::vector<double> scale;                 ///< one per feature, nonzero
    std::vector<ValueRange> domain;            ///< one per raw feature
    Activation activation = Activation::relu;
    Precision precision = Precision::f32;
    double threshold = 0;  ///< an event is predicted if the logit is not below it
    double step_min = 0;   ///< [s] smallest step the model was trained for
    double step_max = 0;   ///< [s] largest step the model was trained for
    std::uint64_t seed = 0;
    std::vector<DenseLayer> layers;
    SelfTest self_test;
    std::string certificate;          ///< empty: none
    std::vector<GateLevel> levels{};  ///< decisions of a gate; else empty
    Calibration calibration{};        ///< measured behaviour of a gate
    /// Layers of a guard whose input is added to their output after the activation, ascending.
    std::vector<std::size_t> residual{};
};

// Models in files: the safetensors format, with provenance in its metadata.
//
// Eight bytes give the length of a JSON header, little-endian; the header gives
// type, shape and offset of each tensor; the rest of the file is the tensors.
//
//     layers.<k>.weight   outputs x inputs, F32 or F64, k = 0, 1, ...
//     layers.<k>.bias     outputs
//     __metadata__        strings; numbers in decimal, lists separated by spaces
//         ricochet           "1", the version of this list
//         kind               "event-classifier", "guard", "gate-horizon", "gate-level" or
//                            "step-policy"
//         system             name
//         parameters         name=value ...
//         recipe             name of what is computed from (t, x, h)
//         offset, scale      one number per feature
//         domain             lower and upper per feature
//         activation         "relu" or "tanh"; of a guard also "softplus", "silu" or "sin"
//         residual           of a guard, optional: layers to whose output their input is added
//         threshold          number
//         step_range         smallest and largest step [s]
//         seed               integer
//         self_test_input    raw features
//         self_test_output   the outputs of the model for them
//         certificate        optional
//         levels             of a gate: value and threshold of each
//         calibration        of a gate, optional: events, misses, bound, steps, seed
//
// Files are untrusted: content that does not fit is rejected with one sentence.

/// A model file that cannot be read, written or trusted. The message names file,
/// tensor or metadata entry, what was expected and what was found.
class ModelError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Options of `load_model`.
struct LoadOptions {
    bool allow_non_finite = false;  ///< accept NaN and infinite weights
};

/// Reads a model. @throws ModelError if the file cannot be read or does not fit.
[[nodiscard]] Model load_model(const std::string& path, const LoadOptions& options = {});

/// The model in the bytes of a file; `name` stands for the file in messages.
/// @throws ModelError if they do not fit.
[[nodiscard]] Model parse_model(std::span<const std::byte> bytes, std::string_view name,
                                const LoadOptions& options = {});

/// The bytes of a file. Numbers keep their bits, but for weights of an f32 model,
/// which are rounded to float. An empty self-test is filled in, at the centre of
/// the domain. The options are those with which the file will be loaded.
/// @throws ModelError if a load with these options would reject the bytes.
[[nodiscard]] std::vector<std::byte> to_safetensors(const Model& model,
                                                    const LoadOptions& options = {});

/// Writes to a temporary file beside `path` and renames it, so that the file is complete or
/// unchanged, and nothing else is left behind.
/// @throws ModelError if the file cannot be written, or as `to_safetensors`.
void save_model(const Model& model, const std::string& path, const LoadOptions& options = {});

}  // namespace ricochet
