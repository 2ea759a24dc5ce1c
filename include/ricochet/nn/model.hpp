// A trained network as it is stored: layers, and what they were trained for.
//
// Plain data. `nn/safetensors.hpp` reads and writes it, `nn/mlp.hpp` evaluates
// it, `learn/` makes it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace ricochet {

/// Activation after every hidden layer; the last layer is linear.
enum class Activation { relu, tanh };

/// How the weights are stored, and in what arithmetic they are evaluated.
enum class Precision { f32, f64 };

/// y = weight x + bias.
struct DenseLayer {
    std::size_t inputs = 0;
    std::size_t outputs = 0;
    std::vector<double> weight;  ///< outputs x inputs, row by row
    std::vector<double> bias;    ///< outputs
};

/// A closed range; the domain of a model is one per feature.
struct Interval {
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
/// Values rise; the thresholds of a level gate do not.
struct GateLevel {
    double value = 0;
    double threshold = 0;
};

/// Behaviour of a gate on runs that it was not made from.
struct Calibration {
    std::uint64_t events = 0;  ///< of the runs; 0: none were made
    std::uint64_t misses = 0;  ///< of these, events that a gated run did not find
    double miss_bound = 1;     ///< of the share that is missed, at 95 % confidence
    std::uint64_t steps = 0;   ///< of the runs
    std::uint64_t seed = 0;    ///< of the runs
};

/// A multilayer perceptron and its provenance.
///
///     y = mlp((features - offset) * scale)
///
/// with `features` computed from (t, x, h) by the recipe of that name.
struct Model {
    /// Or "gate-horizon", "gate-level", "step-policy", "step-actor".
    std::string kind = "event-classifier";
    std::string system;                        ///< e.g. "bouncing-ball"
    std::map<std::string, double> parameters;  ///< of the system, those the model depends on
    std::string recipe;                        ///< e.g. "state"
    std::vector<double> offset;                ///< one per feature
    std::vector<double> scale;                 ///< one per feature, nonzero
    std::vector<Interval> domain;              ///< one per raw feature
    Activation activation = Activation::relu;
    Precision precision = Precision::f32;
    double threshold = 0;  ///< an event is predicted where the logit is not below it
    double step_min = 0;   ///< [s] smallest step the model was trained for
    double step_max = 0;   ///< [s] largest step the model was trained for
    std::uint64_t seed = 0;
    std::vector<DenseLayer> layers;
    SelfTest self_test;
    std::string certificate;          ///< empty: none
    std::vector<GateLevel> levels{};  ///< of a gate
    Calibration calibration{};        ///< of a gate
};

}  // namespace ricochet
