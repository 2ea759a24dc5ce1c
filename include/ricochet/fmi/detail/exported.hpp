// Internal: the declarations of this header may change without notice.
//
// A model behind the functions of FMI: what its description says, and one instance of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/fmi/variable.hpp"
#include "ricochet/run.hpp"

namespace ricochet::fmi::detail {

/// What the description of a model says.
struct ModelFacts {
    std::string name, identifier;
    std::vector<Exported> states, parameters, inputs, outputs;
    std::vector<std::string> guards;
    bool modes = false;           ///< has an output `mode`
    bool rates = true;            ///< of the states are variables, too
    bool tunable = true;          ///< parameters may change during a run
    bool model_exchange = false;  ///< is offered
    bool co_simulation = false;
    double t_start = 0, t_end = 1;  ///< [s] of the default experiment
    /// What the library is told of the model by the end of the token, where it has several.
    std::string told{};
    /// What the names of variables point to where they are not known when the library is compiled.
    std::shared_ptr<std::deque<std::string>> names = std::make_shared<std::deque<std::string>>();

    [[nodiscard]] const char* keep(std::string name)
    {
        return names->emplace_back(std::move(name)).c_str();
    }
    /// Takes start values, "name=value" with spaces between them, of parameters and states.
    /// @throws std::invalid_argument for other words
    void take_starts(std::string_view words);
};

/// By what a library with several models knows the one that is wanted.
struct ModelSource {
    std::string_view told{};      ///< see `ModelFacts`
    std::string_view resource{};  ///< content of `resources/model.json`, if there is one
};

/// What a round of event iteration ended with.
struct ModelUpdate {
    bool again = false, states_changed = false;
    double next_time = std::numeric_limits<double>::infinity();  ///< [s]
};

/// What a communication step ended with.
struct ModelStep {
    bool event = false;   ///< one waits to be handled
    std::string failure;  ///< the reason for which the run cannot go on; empty: it can
};

/// Everything that the future of an instance depends on.
struct ModelState {
    Snapshot own;                 ///< numbers and counts, in the order of `visit`
    std::optional<Snapshot> run;  ///< of co-simulation
};

/// One instance. `t` and the vectors are set from outside between calls.
class ExportedModel {
public:
    explicit ExportedModel(ModelFacts facts);
    virtual ~ExportedModel() = default;
    ExportedModel(const ExportedModel&) = delete;
    ExportedModel& operator=(const ExportedModel&) = delete;

    [[nodiscard]] const ModelFacts& facts() const noexcept { return facts_; }

    double t = 0;  ///< [s]
    std::vector<double> x, parameters, inputs;
    Mode mode = 0;
    std::uint64_t events = 0;
    bool changed = false;  ///< parameters or inputs, since the system was made

    /// At the end of the initialization.
    virtual void start() = 0;
    virtual void rates(std::span<double> dxdt) = 0;
    virtual void outputs(std::span<double> values) = 0;

    // Model exchange. Between events a model is a function of `t`, `x` and `inputs`.
    virtual void indicators(std::span<double> z) = 0;
    virtual ModelUpdate update() = 0;

    // Co-simulation.
    /// Advances to the time `to` [s], or to the next event, before it, if that has to be handled.
    [[nodiscard]] virtual ModelStep step(double to, bool stops_at_events) = 0;
    /// The state after an event that waits.
    virtual void handle_event() = 0;

    [[nodiscard]] virtual ModelState save() = 0;
    /// @throws std::invalid_argument if it is no state of this model
    virtual void restore(const ModelState& state) = 0;

private:
    ModelFacts facts_;
};

/// Defined by RICOCHET_FMU. @throws std::invalid_argument if the library has no such model
[[nodiscard]] std::unique_ptr<ExportedModel> make_exported_model(const ModelSource& source);

}  // namespace ricochet::fmi::detail
