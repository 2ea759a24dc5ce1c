// The module `_learn`: training and certification, for python/ricochet/_training.py.

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "adapted_system.hpp"
#include "arrays.hpp"
#include "background.hpp"
#include "ricochet/learn/certify.hpp"
#include "ricochet/learn/train.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::python {

namespace {

using learn::CertifyOptions;
using learn::ClassifierTraining;
using learn::GateTraining;
using learn::TrainingOptions;

// --- options ---

template <class Options>
using Setters = std::map<std::string, std::function<void(Options&, const py::handle&)>>;

template <class Options, class T>
[[nodiscard]] auto put(T Options::*member)
{
    return [member](Options& options, const py::handle& value) {
        options.*member = py::cast<T>(value);
    };
}

/// Setter of an option of the training within.
template <class T>
[[nodiscard]] auto put_within(T TrainingOptions::*member)
{
    return [member](ClassifierTraining& options, const py::handle& value) {
        options.training.*member = py::cast<T>(value);
    };
}

template <class Options>
void read(Options& options, const py::dict& given, const Setters<Options>& known)
{
    for (const auto& [key, value] : given) {
        const auto name = py::cast<std::string>(key);
        const auto setter = known.find(name);
        if (setter == known.end()) {
            std::string all;
            for (const auto& [option, set] : known) all += (all.empty() ? "" : ", ") + option;
            throw py::type_error("found an option '" + name + "', expected some of " + all);
        }
        try {
            setter->second(options, value);
        } catch (const py::cast_error&) {
            throw py::type_error(name + ": found " + py::cast<std::string>(py::repr(value)));
        }
    }
}

[[nodiscard]] const Setters<ClassifierTraining>& classifier_options()
{
    using C = ClassifierTraining;
    using T = TrainingOptions;
    static const Setters<C> all{
        {"step", put(&C::step)},
        {"run_length", put(&C::run_length)},
        {"surface_points", put(&C::surface_points)},
        {"states", put(&C::states)},
        {"fresh_states", put(&C::fresh_states)},
        {"trial_events", put(&C::trial_events)},
        {"most_steps", put(&C::most_steps)},
        {"margin", put(&C::margin)},
        {"widened", put(&C::widened)},
        {"seed", put(&C::seed)},
        {"hidden", put_within(&T::hidden)},
        {"iterations", put_within(&T::iterations)},
        {"batch", put_within(&T::batch)},
        {"rate", put_within(&T::rate)},
        {"final_rate", put_within(&T::final_rate)},
        {"evaluate_every", put_within(&T::evaluate_every)},
        {"logit_margin", put_within(&T::logit_margin)},
        {"checkpoint", put_within(&T::checkpoint)},
        {"checkpoint_every", put_within(&T::checkpoint_every)},
        {"resume", put_within(&T::resume)},
    };
    return all;
}

[[nodiscard]] const Setters<GateTraining>& gate_options()
{
    using G = GateTraining;
    static const Setters<G> all{
        {"kind",
         [](G& options, const py::handle& value) {
             const auto kind = py::cast<std::string>(value);
             if (kind != "horizon" && kind != "level") {
                 throw py::value_error("kind: found '" + kind + "', expected 'horizon' or 'level'");
             }
             options.kind = kind == "horizon" ? learn::GateKind::horizon : learn::GateKind::level;
         }},
        {"recipe",
         [](G& options, const py::handle& value) {
             options.recipe = gate_recipe(py::cast<std::string>(value));
         }},
        {"levels", put(&G::levels)},
        {"step_min", put(&G::step_min)},
        {"step_max", put(&G::step_max)},
        {"run_length", put(&G::run_length)},
        {"events", put(&G::events)},
        {"states", put(&G::states)},
        {"validation_events", put(&G::validation_events)},
        {"fresh_events", put(&G::fresh_events)},
        {"most_steps", put(&G::most_steps)},
        {"hidden", put(&G::hidden)},
        {"iterations", put(&G::iterations)},
        {"rounds", put(&G::rounds)},
        {"hard_events", put(&G::hard_events)},
        {"neighbours", put(&G::neighbours)},
        {"batch", put(&G::batch)},
        {"rate", put(&G::rate)},
        {"final_rate", put(&G::final_rate)},
        {"evaluate_every", put(&G::evaluate_every)},
        {"patience", put(&G::patience)},
        {"fatal_weight", put(&G::fatal_weight)},
        {"quantile", put(&G::quantile)},
        {"logit_margin", put(&G::logit_margin)},
        {"seed", put(&G::seed)},
        {"checkpoint", put(&G::checkpoint)},
        {"resume", put(&G::resume)},
    };
    return all;
}

[[nodiscard]] const Setters<CertifyOptions>& certify_options()
{
    using C = CertifyOptions;
    static const Setters<C> all{
        {"margin", put(&C::margin)},         {"levels", put(&C::levels)},
        {"ratio", put(&C::ratio)},           {"margins", put(&C::margins)},
        {"search", put(&C::search)},         {"closest", put(&C::closest)},
        {"smallest", put(&C::smallest)},     {"max_unproved", put(&C::max_unproved)},
        {"limit", put(&C::limit)},           {"time_limit", put(&C::time_limit)},
        {"threads", put(&C::threads)},       {"seed", put(&C::seed)},
        {"checkpoint", put(&C::checkpoint)}, {"resume", put(&C::resume)},
    };
    return all;
}

// --- starts ---

using Rows = std::vector<State>;

/// Starts that are uniform in the box between two states, or drawn from a list of states.
[[nodiscard]] learn::Starts<State> starts_from(const Rows& states, bool box, Mode mode)
{
    if (box) return learn::from_box(states[0], states[1], 0, 0, mode);
    return [states, mode](learn::Random& random) {
        return learn::RunStart<State>{.x = states[random.below(states.size())], .mode = mode};
    };
}

// --- results ---

[[nodiscard]] py::object bytes_of(Model model, const Source& source)
{
    if (model.layers.empty()) return py::none();
    for (const auto& [name, value] : source.parameters) model.parameters[name] = value;
    const std::vector<std::byte> bytes = to_safetensors(model);
    return py::bytes(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

/// Returns the result, or raises the exception that was raised during the work, with the result
/// attached to it.
template <class Progress>
[[nodiscard]] py::object handed_back(const Background<Progress>& background,
                                     const py::object& result, const py::function& wrap)
{
    if (!background.raised()) return wrap(result);
    const PythonError& error = *background.raised();
    {
        const py::object kept = wrap(result);
        if (PyObject_SetAttrString(error.value(), "ricochet_trained", kept.ptr()) != 0) {
            PyErr_Clear();
        }
    }
    error.restore();
    throw py::error_already_set();
}

[[nodiscard]] Background<learn::Progress>::Show shower(const py::object& progress)
{
    if (progress.is_none()) return {};
    return [&progress](const learn::Progress& now) {
        using namespace py::literals;
        const py::object goes_on =
            progress("stage"_a = std::string(now.stage), "iteration"_a = now.iteration,
                     "total"_a = now.total, "loss"_a = now.loss, "misses"_a = now.misses,
                     "seconds"_a = now.seconds);
        return !goes_on.is(py::bool_(false));
    };
}

[[nodiscard]] Options run_options(const py::dict& given)
{
    static const Setters<Options> known{
        {"rtol", put(&Options::rtol)},
        {"atol", put(&Options::atol)},
        {"event_tolerance", put(&Options::event_tolerance)},
        {"event_window", put(&Options::event_window)},
        {"h_max", put(&Options::h_max)},
    };
    Options options;
    read(options, given, known);
    return options;
}

py::object train_classifier(const std::shared_ptr<Source>& source, const Rows& states, bool box,
                            Mode mode, const std::string& method, const py::dict& tolerances,
                            const py::dict& given, const py::object& progress,
                            const py::function& wrap)
{
    ClassifierTraining training;
    read(training, given, classifier_options());
    const AdaptedSystem system(*source, states.at(0));
    if (system.guard_count() != 1) {
        throw py::value_error("train_classifier: found a system of " +
                              std::to_string(system.guard_count()) +
                              " guards, expected one; train_gate takes many");
    }
    const SingleGuardSystem single(system);
    Options options = run_options(tolerances);
    Background<learn::Progress> background(shower(progress));
    options.cancelled = &background.stopped();
    training.training.cancelled = &background.stopped();
    const learn::ProgressCallback report = [&](const learn::Progress& now) {
        return background.report(now);
    };
    const auto starts = starts_from(states, box, mode);
    learn::TrainedClassifier trained;
    background.run([&] {
        if (method == "rk4") {
            trained = learn::train_classifier(single, starts, FixedStep<Rk4>{}, options, training,
                                              report);
        } else {
            trained = learn::train_classifier(single, starts, FixedStep<Dopri5>{}, options,
                                              training, report);
        }
    });
    using namespace py::literals;
    const learn::ClassifierTrial& trial = trained.trial;
    const bool has_model = !trained.model.layers.empty();
    const bool misses_none = has_model && trained.misses_none();
    return handed_back(
        background,
        py::dict("content"_a = bytes_of(std::move(trained.model), *source),
                 "report"_a = has_model ? py::object(py::str(to_json(trained.report)))
                                        : py::object(py::none()),
                 "outcome_text"_a = std::string(describe(trained.report.outcome)),
                 "outcome"_a = static_cast<int>(trained.report.outcome),
                 "misses_none"_a = misses_none,
                 "verdict"_a = trial.steps > 0 ? trial.describe() : std::string(),
                 "trial"_a = py::dict("events"_a = trial.events, "missed"_a = trial.missed,
                                      "steps"_a = trial.steps, "exact_calls"_a = trial.exact_calls,
                                      "network_calls"_a = trial.network_calls,
                                      "exact_seconds"_a = trial.exact_seconds,
                                      "network_seconds"_a = trial.network_seconds)),
        wrap);
}

py::object train_gate(const std::shared_ptr<Source>& source, const Rows& states, bool box,
                      Mode mode, const std::string& method, const py::dict& tolerances,
                      const py::dict& given, const py::object& progress, const py::function& wrap)
{
    GateTraining training;
    read(training, given, gate_options());
    const AdaptedSystem system(*source, states.at(0));
    if (system.guard_count() == 0) {
        throw py::value_error("train_gate: found a system without guards, expected at least one");
    }
    if (training.kind == learn::GateKind::level && !system.is_bounded()) {
        throw py::value_error(
            "train_gate: found no bounds, expected a speed_bound for a gate of levels");
    }
    Options options = run_options(tolerances);
    Background<learn::Progress> background(shower(progress));
    options.cancelled = &background.stopped();
    training.cancelled = &background.stopped();
    const learn::ProgressCallback report = [&](const learn::Progress& now) {
        return background.report(now);
    };
    const auto starts = starts_from(states, box, mode);
    learn::TrainedGate trained;
    background.run([&] {
        const auto train = [&](const auto& stepping) {
            trained = learn::train_gate(system, starts, stepping, options, training, report);
        };
        const bool fixed = training.step_max > 0;
        if (!fixed) return train(ErrorControlled<Dopri5>{});
        method == "rk4" ? train(FixedStep<Rk4>{}) : train(FixedStep<Dopri5>{});
    });
    using namespace py::literals;
    // A network that was stopped before the first evaluation clears nothing.
    if (trained.report.outcome == learn::TrainingOutcome::stopped &&
        std::all_of(trained.model.levels.begin(), trained.model.levels.end(),
                    [](const GateLevel& level) { return level.threshold <= -1e30; })) {
        trained.model.layers.clear();
    }
    const learn::GateTrial& trial = trained.report.trial;
    const bool has_model = !trained.model.layers.empty();
    return handed_back(
        background,
        py::dict("content"_a = bytes_of(std::move(trained.model), *source),
                 "report"_a = has_model ? py::object(py::str(to_json(trained.report)))
                                        : py::object(py::none()),
                 "outcome_text"_a = std::string(describe(trained.report.outcome)),
                 "outcome"_a = static_cast<int>(trained.report.outcome),
                 "misses_none"_a = trial.events > 0 && trial.misses == 0,
                 "verdict"_a = learn::describe(trial.rivals),
                 "trial"_a = py::dict(
                     "events"_a = trial.events, "missed"_a = trial.misses,
                     "miss_bound"_a = trial.events > 0 ? trial.miss_bound() : 1.0,
                     "steps"_a = trial.steps, "exact_calls"_a = trial.exact_calls,
                     "gated_calls"_a = trial.gated_calls, "network_calls"_a = trial.network_calls,
                     "outside"_a = trial.outside, "repeated_steps"_a = trial.repeated)),
        wrap);
}

// --- certification ---

/// SystemAdapters to one system, one for each concurrent call, since the threads of a proof share
/// the system.
class SystemAdapters {
public:
    SystemAdapters(const Source& source, const State& like) : source_(&source), like_(like) {}

    template <class Use>
    auto with(const Use& use)
    {
        std::unique_ptr<AdaptedSystem> adapter;
        {
            const std::scoped_lock lock(mutex_);
            if (!free_.empty()) {
                adapter = std::move(free_.back());
                free_.pop_back();
            }
        }
        if (!adapter) {
            const Interpreter held(true);
            adapter = std::make_unique<AdaptedSystem>(*source_, like_);
        }
        const auto result = use(*adapter);
        const std::scoped_lock lock(mutex_);
        free_.push_back(std::move(adapter));
        return result;
    }

private:
    const Source* source_;
    State like_;
    std::mutex mutex_;
    std::vector<std::unique_ptr<AdaptedSystem>> free_;
};

/// Value of a bound that is a Python function of one or two arrays.
[[nodiscard]] double number_from(const py::object& function, const char* what, std::size_t n,
                                 const double* a, const double* b)
{
    const Interpreter held(true);
    try {
        const auto array = [n](const double* data) { return array_of(std::span(data, n)); };
        py::object result = b ? function(array(a), array(b)) : function(array(a));
        if (py::isinstance<py::array>(result) && py::cast<py::ssize_t>(result.attr("size")) == 1) {
            result = result.attr("item")();
        }
        if (!py::isinstance<py::float_>(result) && !PyNumber_Check(result.ptr())) {
            throw py::type_error(std::string(what) + " returned " +
                                 py::cast<std::string>(py::repr(result)) + ", expected a number");
        }
        return py::cast<double>(result);
    } catch (py::error_already_set& error) {
        error.restore();
        throw PythonError();
    } catch (const py::builtin_exception& error) {
        error.set_error();
        throw PythonError();
    }
}

/// @throws std::invalid_argument or value_error for a model of another system
void check_certifiable(const Model& model, const AdaptedSystem& system)
{
    if (system.guard_count() == 0) {
        throw py::value_error("certify: found a system without guards, expected at least one");
    }
    learn::detail::check_certifiable(model, system.name, model.domain.size());
    for (const auto& [name, trained] : model.parameters) {
        learn::detail::check_parameter(name, trained, system.parameter(name));
    }
}

[[nodiscard]] Background<learn::CertifyProgress>::Show shower_of_proof(const py::object& progress)
{
    if (progress.is_none()) return {};
    return [&progress](const learn::CertifyProgress& now) {
        using namespace py::literals;
        const py::object goes_on = progress(
            "stage"_a = "proving", "level"_a = now.level, "levels"_a = now.levels,
            "margin"_a = now.margin, "threshold"_a = now.threshold, "boxes"_a = now.boxes,
            "share"_a = now.share, "seconds"_a = now.seconds, "seconds_left"_a = now.seconds_left);
        return !goes_on.is(py::bool_(false));
    };
}

/// The slack of a guard by constants, the sum of l_i h_i, from n numbers.
[[nodiscard]] std::function<double(const double*)> constant_slack(const py::object& given,
                                                                  std::size_t n)
{
    auto constants = py::cast<std::vector<double>>(given);
    if (constants.size() != n) {
        throw py::value_error("slack: found " + std::to_string(constants.size()) +
                              " numbers, expected " + std::to_string(n));
    }
    for (const double l : constants) {
        if (!(l >= 0)) throw py::value_error("slack: found a number that is negative or NaN");
    }
    return [constants = std::move(constants)](const double* h) {
        double sum = 0;
        for (std::size_t i = 0; i < constants.size(); ++i) sum += constants[i] * h[i];
        return sum;
    };
}

/// The levels, estimates and outcome of a certification, and the bytes of the model.
[[nodiscard]] py::dict summary_of(learn::CertifiedModel& certified, const Source& source)
{
    using namespace py::literals;
    py::list levels;
    for (std::size_t i = 0; i < certified.report.levels.size(); ++i) {
        const CertificateLevel& level = certified.report.levels[i];
        levels.append(py::dict("margin"_a = level.margin, "threshold"_a = level.threshold,
                               "clears"_a = certified.report.clears[i], "boxes"_a = level.boxes,
                               "seconds"_a = level.seconds, "unproved"_a = level.unproved.size()));
    }
    py::list estimates;
    for (const learn::Estimate& e : certified.report.estimates) {
        estimates.append(py::dict("boxes"_a = e.boxes, "seconds"_a = e.seconds,
                                  "unproved"_a = e.unproved, "error"_a = e.error));
    }
    return py::dict("content"_a = bytes_of(std::move(certified.model), source),
                    "proved"_a = certified.proved(),
                    "outcome"_a = static_cast<int>(certified.report.outcome),
                    "outcome_text"_a = describe(certified.report), "levels"_a = levels,
                    "estimates"_a = estimates, "counterexample"_a = certified.report.counterexample,
                    "seconds"_a = certified.report.seconds);
}

py::object certify(const py::bytes& content, const std::shared_ptr<Source>& source,
                   const py::object& slack, const py::object& least, const py::dict& given,
                   const py::object& progress, const py::function& wrap)
{
    CertifyOptions options;
    read(options, given, certify_options());
    const std::string_view text = content;
    const Model model =
        parse_model(std::as_bytes(std::span(text.data(), text.size())), "the network");
    const std::size_t n = model.domain.size();
    SystemAdapters adapters(*source, State(n));
    adapters.with([&](const AdaptedSystem& system) {
        check_certifiable(model, system);
        return 0;
    });

    Background<learn::CertifyProgress> background(shower_of_proof(progress));
    const auto unless_stopped = [&](const auto& evaluate) {
        if (background.stopped()) throw learn::CertifyInterrupted{};
        return evaluate();
    };
    learn::GuardProblem problem;
    problem.guard = [&](const double* x) {
        return unless_stopped([&] {
            return adapters.with([&](const AdaptedSystem& system) {
                return system.guard(0, 0, 0.0, State(x, x + n));
            });
        });
    };
    if (PyCallable_Check(slack.ptr())) {
        problem.slack = [&](const double* h) {
            return unless_stopped([&] { return number_from(slack, "slack", n, h, nullptr); });
        };
    } else {
        problem.slack = constant_slack(slack, n);
    }
    if (!least.is_none()) {
        problem.least = [&](const double* lower, const double* upper) {
            return unless_stopped([&] { return number_from(least, "least", n, lower, upper); });
        };
    }

    learn::CertifiedModel certified;
    background.run([&] {
        certified = learn::certify(model, problem, options,
                                   [&](const auto& now) { return background.report(now); });
    });
    return handed_back(background, summary_of(certified, *source), wrap);
}

}  // namespace

}  // namespace ricochet::python

PYBIND11_MODULE(_learn, module)
{
    using namespace ricochet::python;
    py::module_::import("ricochet._ricochet");  // defines the type of systems
    py::register_local_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(thrown);
        } catch (const PythonError& error) {
            error.restore();
        } catch (const ricochet::ModelError& error) {
            PyErr_SetString(PyExc_ValueError, error.what());
        }
    });
    module.def("train_classifier", &train_classifier);
    module.def("train_gate", &train_gate);
    module.def("certify", &certify);
}
