// The systems that the command line knows, as values.
//
// A ready system of the core has its entry from its descriptor. Another one is added by a function
// in a file of systems/ that returns its entry, which systems/entries.hpp declares and lists. If a
// system needs more than the core, its functions are in a file of the program that simulates it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/run.hpp"
#include "ricochet/systems/descriptor.hpp"
#include "settings.hpp"

namespace ricochet::app {

using Range = ParameterRange;
using Parameter = ParameterInfo;
using Component = ComponentInfo;

/// A guard, and the event on its surface.
struct GuardLabel {
    std::string_view name;   ///< "floor"
    std::string_view event;  ///< "impact"
};

/// Counts over set-valued steps.
struct SetValuedSteps {
    std::uint64_t attempted = 0, accepted = 0, rejected = 0, unsolved = 0;
    std::uint64_t solves = 0, iterations = 0, switches = 0;
};

struct HandOverPhase {
    double from = 0;  ///< [s]
    bool set_valued = false;
    std::string_view cause;
};

/// A run for any type of state, with its duration.
struct TimedRun {
    Run<std::vector<double>> run;
    double seconds = 0;                     ///< of wall time, per run
    std::optional<SetValuedSteps> steps{};  ///< if there were any
    std::vector<HandOverPhase> phases{};
};

/// Published event times, for the default parameters.
struct Published {
    std::string_view name;
    std::string_view source;
    std::vector<double> times;  ///< [s]
};

/// A model that comes with the library.
struct OwnModel {
    std::string_view file;  ///< in one of the model directories
    std::string_view kind;  ///< "fixed-step"
    bool any_step;          ///< else it is for one step only
};

struct SystemEntry {
    std::string_view name;
    std::string_view description;  ///< one sentence
    std::string_view source{};     ///< of the problem; empty: it is ricochet's own
    /// Equations of systems with friction, a line each, in the names of parameters and state.
    std::vector<std::string_view> equations{};
    std::vector<Parameter> parameters;
    std::vector<Component> state;
    std::vector<GuardLabel> guards{};
    std::vector<std::string_view> modes{};  ///< their names; empty where there is only one
    double t_start = 0;                     ///< [s] default
    double t_end;                           ///< [s] default

    /// The start for these parameters.
    std::vector<double> (*start)(const std::vector<double>& parameters);

    /// Runs it `repeats` times; the runs are equal and the last is returned.
    TimedRun (*run)(const RunSettings& settings, int repeats);

    /// Whether its flow can be a power series, as required by the stepper taylor.
    bool series = false;

    /// The mode at the start for these parameters; null: mode 0.
    Mode (*start_mode)(const std::vector<double>& parameters) = nullptr;

    /// Specific models precede general ones.
    std::vector<OwnModel> models{};

    /// For a guard that is a parabola in time: the boundary of a step that meets it, in
    /// words. The detector `line` evaluates it. Empty otherwise.
    std::string_view line{};

    /// Known event times [s] up to a time, for comparison; null if none are known.
    /// @throws BadInput if none are known for these parameters.
    std::vector<double> (*exact_events)(const std::vector<double>& parameters,
                                        double t_end) = nullptr;
    bool numerical_reference = false;  ///< they were computed numerically; else in closed form,
    bool any_parameters = true;        ///< and for any parameters; else for the defaults
    std::vector<Published> published{};
    double comparison_step = 0;  ///< [s] of the fixed steps in a comparison

    /// Names for --integrator, the default first; empty where there is only "event".
    std::vector<std::string_view> integrators{};
    double set_valued_step = 0;  ///< [s] of its set-valued steps by default
    /// State at a time, for comparisons of inclusions; empty where it is not known. If null or
    /// empty, a run to 1e-13 serves instead.
    std::vector<double> (*exact_state)(const std::vector<double>& parameters, double t) = nullptr;
    std::vector<std::string_view> published_errors{};  ///< lines of a source

    /// Known solution in words, where the functions that compute it belong to `program`.
    std::string_view known_solution{};

    /// Another program, `ricochet-<name>`, which simulates it; only that program has the functions,
    /// which are null elsewhere.
    std::string_view program{};

    /// Sets the integrator of a differential inclusion; false: as any other system. Else null.
    /// @throws BadInput for options that do not fit the system or the integrator.
    bool (*choose_integrator)(const SystemEntry& system, const RunRequest& request,
                              RunSettings& settings) = nullptr;
};

/// The systems of this program, in the order of the lists: of the command line, in
/// systems/entries.cpp, or of the demo.
[[nodiscard]] std::vector<SystemEntry> all_entries();

[[nodiscard]] const std::vector<SystemEntry>& systems();

/// Fills in the functions of a system, in the program that contains them.
void complete_system(std::string_view name, void (*complete)(SystemEntry& entry));

/// @throws BadInput naming the known systems.
[[nodiscard]] const SystemEntry& find_system(std::string_view name);

}  // namespace ricochet::app
