#include "inspect.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "input.hpp"
#include "joined.hpp"
#include "json_text.hpp"
#include "model_lookup.hpp"
#include "policy_advice.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "ricochet/gate_features.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"
#include "timing.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

/// A model and the results of its inspection.
struct Inspection {
    fs::path file;
    std::uintmax_t bytes = 0;
    Model model;
    std::vector<double> outputs{};  ///< of the self-test, repeated now
    Timing inference{};             ///< from raw features to logit
};

const SystemEntry* system_of(const Model& model)
{
    const auto& all = systems();
    const auto found = std::find_if(all.begin(), all.end(),
                                    [&](const SystemEntry& s) { return s.name == model.system; });
    return found == all.end() ? nullptr : &*found;
}

/// Whether the model chooses steps.
bool is_policy(const Model& model)
{
    return model.kind == StepPolicy::kind;
}

/// Whether the model is the actor of a reinforcement learner.
bool is_actor(const Model& model)
{
    return model.kind == step_actor_kind;
}

/// Names of the features, in the order of the inputs; "feature 0" for an
/// unknown recipe.
std::vector<std::string> feature_names(const Model& model)
{
    std::vector<std::string> names;
    if (model.recipe == name(detail::Recipe::ballistic)) {
        names = {"slog(g / (|g''| h²))", "slog(g' / (|g''| h))"};
    } else if (const SystemEntry* system = system_of(model);
               system != nullptr && model.recipe == name(detail::Recipe::state)) {
        for (const Component& x : system->state) {
            names.push_back(fmt::format("{} [{}]", x.name, x.unit));
        }
    }
    if (is_policy(model)) {
        std::istringstream recipe(model.recipe);
        std::string word;
        for (recipe >> word; recipe >> word;) names.push_back(printable(word));
    }
    if (names.size() == model.offset.size()) return names;
    names.clear();
    for (std::size_t i = 0; i < model.offset.size(); ++i) {
        names.push_back(fmt::format("feature {}", i));
    }
    return names;
}

bool recipe_known(const Model& model)
{
    if (is_policy(model)) return model.recipe.starts_with("step-inputs-1:");
    if (is_actor(model)) return model.recipe == step_actor_recipe;
    if (model.kind != "event-classifier") {
        try {
            (void)gate_recipe(model.recipe);
            return true;
        } catch (const std::invalid_argument&) {
            return false;
        }
    }
    return model.recipe == name(detail::Recipe::state) ||
           model.recipe == name(detail::Recipe::ballistic);
}

/// Weights and biases.
std::size_t number_of_weights(const Model& model)
{
    std::size_t sum = 0;
    for (const DenseLayer& layer : model.layers) sum += layer.weight.size() + layer.bias.size();
    return sum;
}

/// "2 - 16 - 1"
std::string shape(const Model& model)
{
    std::string out = fmt::format("{}", model.layers.front().inputs);
    for (const DenseLayer& layer : model.layers) out += fmt::format(" - {}", layer.outputs);
    return out;
}

std::string_view activation(const Model& model)
{
    return name(model.activation);
}

std::string_view precision(const Model& model)
{
    return model.precision == Precision::f32 ? "f32" : "f64";
}

/// Times batches of inferences on the input of the self-test; no branch of the
/// arithmetic depends on the input.
Timing time_inference(const Classifier& classifier)
{
    using Clock = std::chrono::steady_clock;
    constexpr int batches = 201;
    constexpr double batch_seconds = 5e-5;
    std::vector<double> out(classifier.outputs());
    const double* const features = classifier.model().self_test.input.data();
    const auto seconds_each = [&](int repeats) {
        const auto start = Clock::now();
        for (int i = 0; i < repeats; ++i) classifier.logits(features, out.data());
        return std::chrono::duration<double>(Clock::now() - start).count() / repeats;
    };
    seconds_each(1000);  // wakes the processor up
    const int repeats = 1 + static_cast<int>(batch_seconds / seconds_each(100));
    std::vector<double> seconds;
    for (int batch = 0; batch < batches; ++batch) seconds.push_back(seconds_each(repeats));
    return summarise(std::move(seconds));
}

Inspection look_at(const fs::path& file)
{
    Inspection found{.file = file, .model = load_model(file)};
    found.bytes = fs::file_size(file);
    const Classifier classifier(found.model);
    found.outputs.resize(classifier.outputs());
    classifier.logits(found.model.self_test.input.data(), found.outputs.data());
    found.inference = time_inference(classifier);
    return found;
}

std::string numbers(const std::vector<double>& values)
{
    return fmt::format("({})", joined(values, ", "));
}

/// The reason why the certificate does not hold; empty if it does.
std::string objection(const Model& model)
{
    try {
        return why_void(model);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
}

/// One line for the certificate and one for each of its levels.
std::vector<std::string> certificate_lines(const Model& model)
{
    if (model.certificate.empty()) return {"none"};
    if (const std::string why = objection(model); !why.empty()) {
        constexpr std::size_t most = 200;  // it may be long, and have any content
        return {fmt::format("void: it {}", printable(why)),
                printable(model.certificate.substr(0, most))};
    }
    const Certificate certificate = parse_certificate(model.certificate);
    std::vector<std::string> out{fmt::format("holds, by {}, of {}", printable(certificate.tool),
                                             printable(certificate.fingerprint))};
    for (const CertificateLevel& level : certificate.levels) {
        out.push_back(fmt::format(
            "guard > {} where the logit is below {}; {} boxes in {}, {} unproved", level.margin,
            level.threshold, level.boxes, duration(level.seconds), level.unproved.size()));
    }
    return out;
}

Json certificate_json(const Model& model)
{
    if (model.certificate.empty()) return {};
    const std::string why = objection(model);
    Json out{{"holds", why.empty()}, {"why_void", why.empty() ? Json() : Json(why)}};
    out["record"] = Json::parse(model.certificate, nullptr, false);
    if (out["record"].is_discarded()) out["record"] = model.certificate;
    return out;
}

std::string calibration(const Calibration& c)
{
    if (c.events == 0) return "no: how often events are missed was not measured";
    return fmt::format(
        "{} of {} events of fresh runs missed, at most {:.1e} of them at 95 % confidence; {} "
        "steps, "
        "seed {}",
        c.misses, c.events, c.miss_bound, c.steps, c.seed);
}

constexpr std::string_view unknown_here = " (not known here)";

/// Adds a line with a name and a value.
using AddLine = std::function<void(std::string_view name, const std::string& value)>;

/// The system that the model is for, its parameters and its steps.
void add_system(const Model& model, const AddLine& line)
{
    std::vector<std::string> parameters;
    for (const auto& [name, value] : model.parameters) {
        parameters.push_back(fmt::format("{} = {}", printable(name), value));
    }
    line("system", fmt::format("{}{}, {}", printable(model.system),
                               system_of(model) == nullptr ? unknown_here : "",
                               parameters.empty() ? "whatever its parameters"
                                                  : fmt::format("{}", joined(parameters, ", "))));
    if (!is_policy(model)) {
        line("steps", model.step_min == model.step_max
                          ? fmt::format("{} s only", model.step_min)
                          : fmt::format("{} to {} s", model.step_min, model.step_max));
    }
}

/// The features, and the network that they are put into.
void add_network(const Model& model, const AddLine& line)
{
    line("recipe",
         fmt::format("{}{}", printable(model.recipe), recipe_known(model) ? "" : unknown_here));
    const std::vector<std::string> names = feature_names(model);
    for (std::size_t i = 0; i < names.size(); ++i) {
        line(i == 0 ? "features" : "",
             fmt::format("{}, minus {}, times {}; in [{}, {}]", names[i], model.offset[i],
                         model.scale[i], model.domain[i].lower, model.domain[i].upper));
    }
    line("network", fmt::format("{}, {}, {}, {} weights and biases", shape(model),
                                activation(model), precision(model), number_of_weights(model)));
    for (std::size_t k = 0; k < model.layers.size(); ++k) {
        const DenseLayer& layer = model.layers[k];
        line(k == 0 ? "layers" : "", fmt::format("{}: weight {} x {}, bias {}", k, layer.outputs,
                                                 layer.inputs, layer.outputs));
    }
}

/// The decision that is taken by the output.
void add_decision(const Model& model, const AddLine& line)
{
    if (is_policy(model)) {
        line("decision",
             fmt::format("the classical step times exp(output), held to [{:.3g}, {:.3g}]",
                         std::exp(-StepPolicy::most), std::exp(StepPolicy::most)));
        line("use", std::string(policy_advice(model.system)));
    } else if (is_actor(model)) {
        line("decision", fmt::format("the step is linear in tanh(output), {} to {} s",
                                     model.step_min, model.step_max));
    } else if (model.levels.empty()) {
        line("decision", fmt::format("event where the logit is at least {}", model.threshold));
    }
    for (std::size_t k = 0; k < model.levels.size(); ++k) {
        const GateLevel& level = model.levels[k];
        const bool horizon = model.kind == "gate-horizon";
        line(k == 0 ? "decision" : "",
             fmt::format("{} where {} is below {:.6g}",
                         horizon ? fmt::format("no event within {:.6g} s", level.value)
                                 : fmt::format("guard above {:.6g}", level.value),
                         horizon ? fmt::format("logit {}", k) : "the logit", level.threshold));
    }
    if (!model.levels.empty()) line("calibrated", calibration(model.calibration));
}

std::string to_text(const Inspection& found)
{
    const Model& model = found.model;
    std::string out;
    const auto line = [&](std::string_view name, const std::string& value) {
        out += fmt::format("{:<13}{}\n", name, value);
    };
    line("file", fmt::format("{}, {} bytes", printable(found.file.string()), found.bytes));
    line("kind", printable(model.kind));
    add_system(model, line);
    add_network(model, line);
    add_decision(model, line);
    line("seed", fmt::format("{}", model.seed));
    line("self-test",
         fmt::format("reproduced: {} gives {}, recorded {}", numbers(model.self_test.input),
                     numbers(found.outputs), numbers(model.self_test.output)));
    const std::vector<std::string> certificate = certificate_lines(model);
    for (std::size_t k = 0; k < certificate.size(); ++k) {
        line(k == 0 ? "certificate" : "", certificate[k]);
    }
    line("cost",
         fmt::format("{} an inference (spread {}), {} kernels", duration(found.inference.median),
                     spread(found.inference), name(best_instruction_set())));
    return out;
}

std::string to_json(const Inspection& found)
{
    const Model& model = found.model;
    Json parameters = Json::object();
    for (const auto& [name, value] : model.parameters) parameters[name] = value;
    const std::vector<std::string> names = feature_names(model);
    Json features = Json::array();
    for (std::size_t i = 0; i < names.size(); ++i) {
        features.push_back(
            {{"name", names[i]},
             {"offset", model.offset[i]},
             {"scale", model.scale[i]},
             {"domain", Json::array({model.domain[i].lower, model.domain[i].upper})}});
    }
    Json layers = Json::array();
    for (const DenseLayer& layer : model.layers) {
        layers.push_back({{"inputs", layer.inputs}, {"outputs", layer.outputs}});
    }
    Json levels = Json::array();
    for (const GateLevel& level : model.levels) {
        levels.push_back({{"value", level.value}, {"threshold", level.threshold}});
    }
    const Calibration& c = model.calibration;
    Json calibrated = c.events == 0 ? Json()
                                    : Json{{"events", c.events},
                                           {"misses", c.misses},
                                           {"miss_bound", c.miss_bound},
                                           {"steps", c.steps},
                                           {"seed", c.seed}};
    const Timing& cost = found.inference;
    return json_text({{"file", found.file.string()},
                      {"bytes", found.bytes},
                      {"kind", model.kind},
                      {"system", model.system},
                      {"parameters", parameters},
                      {"step_range", Json::array({model.step_min, model.step_max})},
                      {"recipe", model.recipe},
                      {"features", features},
                      {"layers", layers},
                      {"activation", activation(model)},
                      {"precision", precision(model)},
                      {"weights", number_of_weights(model)},
                      {"threshold", model.threshold},
                      {"levels", levels},
                      {"calibration", calibrated},
                      {"seed", model.seed},
                      {"self_test",
                       {{"reproduced", true},  // or it would not have been loaded
                        {"input", model.self_test.input},
                        {"recorded", model.self_test.output},
                        {"output", found.outputs}}},
                      {"certificate", certificate_json(model)},
                      {"use", is_policy(model) ? policy_advice(model.system) : ""},
                      {"cost",
                       {{"nanoseconds",
                         {{"median", cost.median * 1e9},
                          {"lower_quartile", cost.lower * 1e9},
                          {"upper_quartile", cost.upper * 1e9}}},
                        {"instruction_set", name(best_instruction_set())}}}});
}

}  // namespace

int inspect(const InspectRequest& request)
{
    const Inspection found = look_at(find_model(request.model));
    print(request.json ? to_json(found) : to_text(found));
    return 0;
}

}  // namespace ricochet::app
