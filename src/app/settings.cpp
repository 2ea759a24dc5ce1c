#include "settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "core/detect/named_detectors.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "model_lookup.hpp"
#include "registry.hpp"

namespace ricochet::app {

namespace {

/// A few seconds of cheap steps, whatever the parameters: a longer run must be requested.
constexpr std::uint64_t default_max_steps = 2'000'000;

template <class Kind, std::size_t n>
using Names = std::array<std::pair<std::string_view, Kind>, n>;

constexpr auto detectors = [] {
    constexpr Names<DetectorKind, 5> more{{{"network", DetectorKind::network},
                                           {"verified", DetectorKind::verified},
                                           {"line", DetectorKind::line},
                                           {"certified", DetectorKind::certified},
                                           {"calibrated", DetectorKind::calibrated}}};
    constexpr std::size_t n = ricochet::detail::NamedDetectors::size;
    Names<DetectorKind, n + more.size()> all{};
    for (std::size_t i = 0; i < n; ++i) {
        all[i] = {ricochet::detail::detector_names[i], static_cast<DetectorKind>(i)};
    }
    for (std::size_t i = 0; i < more.size(); ++i) all[n + i] = more[i];
    return all;
}();
constexpr Names<LocatorKind, 3> locators{{{"newton", LocatorKind::newton},
                                          {"bisection", LocatorKind::bisection},
                                          {"toms748", LocatorKind::toms748}}};

template <class Kind, std::size_t n>
std::string_view name_in(const Names<Kind, n>& names, Kind kind)
{
    return std::find_if(names.begin(), names.end(), [&](auto& e) { return e.second == kind; })
        ->first;
}

template <class Kind, std::size_t n>
Kind named(std::string_view what, const Names<Kind, n>& names, std::string_view given)
{
    std::vector<std::string_view> known;
    for (const auto& [name, kind] : names) {
        if (name == given) return kind;
        known.push_back(name);
    }
    throw unknown(what, given, known);
}

Stepper stepper_named(std::string_view given)
{
    if (given == Stepper::taylor().name()) return Stepper::taylor();
    if (const auto method = method_named(given)) return *method;
    std::vector<std::string_view> known;
    for (const auto& method : ricochet::detail::named_methods) known.push_back(method.spelled);
    known.push_back(Stepper::taylor().name());
    throw unknown("stepper", given, known);
}

void require_positive(std::string_view option, double value)
{
    if (!(value > 0)) {
        throw BadInput(fmt::format("{} must be positive, got {}", option, value));
    }
}

void require_not_negative(std::string_view option, double value)
{
    if (!(value >= 0)) {
        throw BadInput(fmt::format("{} must be zero or positive, got {}", option, value));
    }
}

void choose_stepping(const SystemEntry& system, const RunRequest& request, RunSettings& settings)
{
    settings.fixed_step = request.step.has_value();
    settings.stepper = settings.fixed_step ? MethodName::rk4 : MethodName::dopri5;
    if (request.stepper) settings.stepper = stepper_named(*request.stepper);
    if (settings.stepper.is_taylor() && !system.series) {
        throw BadInput(fmt::format(
            "stepper taylor needs a flow that is one formula for numbers and for power series, "
            "and that of {} is none; expected {}",
            system.name, ricochet::detail::spelled_methods(true)));
    }

    Options& options = settings.options;
    if (settings.fixed_step) {
        if (request.rtol || request.atol) {
            throw BadInput(
                "--step takes fixed steps and --rtol and --atol control the error; "
                "expected one or the other, got both");
        }
        require_positive("--step", *request.step);
        options.step = *request.step;
        return;
    }
    if (!settings.stepper.estimates_error()) {
        throw BadInput(
            fmt::format("stepper {} has no error estimate and needs --step; "
                        "expected {} or, for some systems, taylor",
                        settings.stepper.name(), ricochet::detail::spelled_methods(true)));
    }
    options.rtol = request.rtol.value_or(options.rtol);
    options.atol = request.atol.value_or(options.atol);
    require_not_negative("--rtol", options.rtol);
    require_not_negative("--atol", options.atol);
    if (options.rtol == 0 && options.atol == 0) {
        throw BadInput("--rtol or --atol must be positive, got zero for both");
    }
}

/// Refuses a set-valued integrator for a system that is no differential inclusion.
void refuse_integrator(const SystemEntry& system, const RunRequest& request)
{
    if (request.integrator && *request.integrator != "event") {
        throw BadInput(fmt::format(
            "--integrator {} is for differential inclusions, and {} is none; expected event",
            *request.integrator, system.name));
    }
    if (request.controller) {
        throw BadInput("--controller is for --integrator bathe of differential inclusions");
    }
}

Mode mode_named(const SystemEntry& system, std::string_view given)
{
    if (system.modes.empty()) {
        throw BadInput(fmt::format("--mode is for systems with modes, and {} has none, got '{}'",
                                   system.name, given));
    }
    const auto found = std::find(system.modes.begin(), system.modes.end(), given);
    if (found == system.modes.end()) {
        throw unknown(fmt::format("mode of {}", system.name), given, system.modes);
    }
    return static_cast<Mode>(found - system.modes.begin());
}

bool is_gate(DetectorKind kind)
{
    return kind == DetectorKind::verified || kind == DetectorKind::certified ||
           kind == DetectorKind::calibrated;
}

/// Chooses a model that clears more than one step, and the degree to which it is trusted.
void choose_gate(const SystemEntry& system, const RunRequest& request, RunSettings& settings)
{
    if (!request.model) {
        throw BadInput(fmt::format("the {} gate of {} needs a trained model, expected --model FILE",
                                   name(settings.detector), system.name));
    }
    FoundModel found = named_gate(system, settings, *request.model);
    if (settings.detector == DetectorKind::certified && found.model.certificate.empty()) {
        throw BadInput(fmt::format("model '{}' has no certificate, see ricochet certify",
                                   found.file.string()));
    }
    if (settings.detector == DetectorKind::verified && found.model.kind != "gate-horizon") {
        throw BadInput(
            fmt::format("the verified gate forecasts with a gate-horizon, model '{}' is "
                        "a {}",
                        found.file.string(), found.model.kind));
    }
    if (settings.detector == DetectorKind::calibrated && !settings.fixed_step &&
        found.model.step_min == found.model.step_max) {
        throw BadInput(
            fmt::format("model '{}' is for fixed steps of {} s; expected --step {}, or a gate "
                        "trained for error control",
                        found.file.string(), found.model.step_min, found.model.step_min));
    }
    settings.model = std::move(found.file);
    // The misses of an unverified gate are known only for such steps.
    if (settings.detector == DetectorKind::calibrated && !settings.fixed_step) {
        settings.options.h_min = found.model.step_min;
        settings.options.h_max = found.model.step_max;
    }
    settings.gate = std::move(found.model);
}

void choose_detector(const SystemEntry& system, const RunRequest& request, RunSettings& settings)
{
    if (request.gate) {
        if (request.detector) {
            throw BadInput("--gate is a detector, too; expected one of the two, got both");
        }
        settings.detector = named("gate", detectors, *request.gate);
        if (!is_gate(settings.detector) && settings.detector != DetectorKind::network) {
            throw unknown("gate", *request.gate,
                          {"verified", "certified", "calibrated", "network"});
        }
    } else if (request.detector) {
        settings.detector = named("detector", detectors, *request.detector);
    } else if (request.model) {
        settings.detector = DetectorKind::network;
    }
    if (settings.detector == DetectorKind::line && system.line.empty()) {
        throw BadInput(
            fmt::format("the detector line is for guards that are parabolas in time, which those "
                        "of {} are not",
                        system.name));
    }
    if (is_gate(settings.detector)) {
        // The models of a system that has some are for single steps.
        if (system.models.empty()) return choose_gate(system, request, settings);
        if (settings.detector != DetectorKind::verified) {
            throw BadInput(
                fmt::format("the {} gate is not for {}, whose networks are of single "
                            "steps; expected verified",
                            name(settings.detector), system.name));
        }
    }
    const bool bare = settings.detector == DetectorKind::network;
    if (!bare && settings.detector != DetectorKind::verified) {
        if (request.model) {
            throw BadInput(
                fmt::format("--model is for the detectors network and verified, got --detector {}",
                            name(settings.detector)));
        }
        return;
    }
    if (system.models.empty()) {
        throw BadInput(fmt::format(
            "the detector {} needs a network, and none can be used with {}; expected {}",
            name(settings.detector), system.name, ricochet::detail::spelled_detectors()));
    }
    FoundModel found = request.model ? named_model(system, settings, *request.model)
                                     : suitable_model(system, settings);
    if (bare && !settings.fixed_step) {  // `verified` takes the steps of its exact detector
        settings.options.h_min = found.model.step_min;
        settings.options.h_max = found.model.step_max;
    }
    settings.model = std::move(found.file);
    settings.network.emplace(std::move(found.model));
}

}  // namespace

std::string_view name(DetectorKind kind) noexcept
{
    return name_in(detectors, kind);
}
std::string_view name(LocatorKind kind) noexcept
{
    return name_in(locators, kind);
}
std::vector<double> parameter_values(const SystemEntry& system, const std::vector<std::string>& set)
{
    std::vector<double> values;
    std::vector<std::string_view> known;
    for (const Parameter& parameter : system.parameters) {
        values.push_back(parameter.initial);
        known.push_back(parameter.name);
    }
    std::vector<bool> is_set(values.size(), false);
    for (const std::string& text : set) {
        const Assignment given = assignment("--set", text);
        const auto found = std::find(known.begin(), known.end(), given.name);
        if (found == known.end()) {
            throw unknown(fmt::format("parameter of {}", system.name), given.name, known);
        }
        const auto i = static_cast<std::size_t>(found - known.begin());
        const Parameter& parameter = system.parameters[i];
        if (is_set[i]) {
            throw BadInput(fmt::format("{} of {} is set twice", parameter.name, system.name));
        }
        is_set[i] = true;
        if (!parameter.range.contains(given.value)) {
            throw BadInput(fmt::format(
                "{} of {} must lie in {}{}, got {}", parameter.name, system.name,
                to_string(parameter.range),
                parameter.unit == "1" ? "" : fmt::format(" {}", parameter.unit), given.value));
        }
        values[i] = given.value;
    }
    return values;
}

RunSettings resolve(const SystemEntry& system, const RunRequest& request)
{
    RunSettings settings;
    settings.parameters = parameter_values(system, request.set);

    Options& options = settings.options;
    options.t_start = request.t_start.value_or(system.t_start);
    options.t_end = request.t_end.value_or(system.t_end);
    if (system.start_mode != nullptr) options.mode = system.start_mode(settings.parameters);
    if (request.mode) options.mode = mode_named(system, *request.mode);
    options.event_tolerance = request.event_tolerance.value_or(0);
    require_not_negative("--event-tolerance", options.event_tolerance);
    options.max_steps = request.max_steps.value_or(default_max_steps);
    options.cancelled = Interrupts::flag();

    if (system.choose_integrator != nullptr) {
        if (system.choose_integrator(system, request, settings)) return settings;
    } else {
        refuse_integrator(system, request);
    }
    choose_stepping(system, request, settings);
    if (request.locator) settings.locator = named("locator", locators, *request.locator);
    choose_detector(system, request, settings);
    return settings;
}

std::string describe_stepping(const RunSettings& settings)
{
    const Options& options = settings.options;
    return settings.fixed_step ? fmt::format("{}, step {} s", settings.stepper.name(), options.step)
                               : fmt::format("{}, rtol {}, atol {}", settings.stepper.name(),
                                             options.rtol, options.atol);
}

}  // namespace ricochet::app
