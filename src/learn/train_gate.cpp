#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/train.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/require.hpp"
#include "limits.hpp"
#include "ricochet/learn/assessment.hpp"

namespace ricochet::learn {

namespace {

constexpr ricochet::detail::Refuse refuse_training{"train_gate"};

void require_positive(double value, const char* name)
{
    ricochet::detail::require_positive(refuse_training.who, name, value);
}

}  // namespace

std::string_view name(GateKind kind) noexcept
{
    return kind == GateKind::horizon ? "gate-horizon" : "gate-level";
}

void check(const GateTraining& training, bool fixed_step)
{
    if (training.levels.empty() || training.levels.size() > 32) {
        refuse_training(fmt::format("expected 1 to 32 levels, got {}", training.levels.size()));
    }
    double before = 0;
    for (const double level : training.levels) {
        if (!(level > before && std::isfinite(level))) {
            refuse_training(
                fmt::format("levels must be positive and rise, got {} after {}", level, before));
        }
        before = level;
    }
    if (fixed_step) {
        require_positive(training.step_min, "step_min");
        require_positive(training.step_max, "step_max");
        if (training.step_min > training.step_max) {
            refuse_training(fmt::format("step_min {} is above step_max {}", training.step_min,
                                        training.step_max));
        }
    }
    require_positive(training.run_length, "run_length");
    require_positive(training.rate, "rate");
    require_positive(training.final_rate, "final_rate");
    for (const auto& [value, what] : {std::pair{training.events, "events"},
                                      {training.states, "states"},
                                      {training.validation_events, "validation_events"},
                                      {training.iterations, "iterations"},
                                      {training.rounds, "rounds"},
                                      {training.batch, "batch"},
                                      {training.evaluate_every, "evaluate_every"},
                                      {training.patience, "patience"},
                                      {training.most_steps, "most_steps"}}) {
        if (value == 0) refuse_training(fmt::format("{} must be positive, got 0", what));
    }
    if (!(training.quantile > 0 && training.quantile < 1)) {
        refuse_training(fmt::format("quantile must lie in (0, 1), got {}", training.quantile));
    }
    if (!(training.logit_margin >= 0 && training.fatal_weight >= 0)) {
        refuse_training("logit_margin and fatal_weight must not be negative");
    }
}

void GateSamples::append(std::span<const double> row, double event_in, double back_in,
                         double value_now, double stands_for)
{
    features.insert(features.end(), row.begin(), row.end());
    event.push_back(event_in);
    back.push_back(back_in);
    value.push_back(value_now);
    weight.push_back(stands_for);
}

void GateSamples::append(const GateSamples& other)
{
    width = other.width;
    const auto add = [](std::vector<double>& to, const std::vector<double>& from) {
        to.insert(to.end(), from.begin(), from.end());
    };
    add(features, other.features);
    add(event, other.event);
    add(back, other.back);
    add(value, other.value);
    add(weight, other.weight);
    events += other.events;
    steps += other.steps;
}

void GateSamples::visit(std::span<const double> row)
{
    if (box.empty()) box.assign(row.size(), {.lower = infinity, .upper = -infinity});
    for (std::size_t i = 0; i < row.size(); ++i) {
        box[i].lower = std::min(box[i].lower, row[i]);
        box[i].upper = std::max(box[i].upper, row[i]);
    }
}

double GateTrial::miss_bound() const
{
    return learn::miss_bound(misses, events);
}

std::string to_json(const GateReport& report)
{
    const GateTrial& t = report.trial;
    nlohmann::ordered_json out{{"outcome", describe(report.outcome)},
                               {"iterations", report.iterations},
                               {"seconds", report.seconds},
                               {"training_states", report.training_states},
                               {"fatal_states", report.fatal_states},
                               {"events", report.events},
                               {"expected_looks_per_step", report.looks},
                               {"guard_calls", report.guard_calls},
                               {"calibration",
                                {{"events", report.calibration.events},
                                 {"misses", report.calibration.misses},
                                 {"miss_bound", report.calibration.miss_bound()},
                                 {"checks_per_event", report.calibration.checks_per_event},
                                 {"shift", report.calibration.shift}}},
                               {"trial",
                                {{"events", t.events},
                                 {"misses", t.misses},
                                 {"miss_bound", t.miss_bound()},
                                 {"steps", t.steps},
                                 {"exact_calls", t.exact_calls},
                                 {"gated_calls", t.gated_calls},
                                 {"gain", t.gain()},
                                 {"network_calls", t.network_calls},
                                 {"outside", t.outside},
                                 {"repeated_steps", t.repeated},
                                 {"verdict", report.describe()}}}};
    return out.dump(2);
}

namespace detail {

void throw_no_start(const std::string& why)
{
    refuse_training("none of 1000 starts can be run: " + why);
}

void throw_no_features(const std::string& recipe, std::size_t components)
{
    refuse_training(fmt::format("the recipe '{}' cannot be computed from a state of {} components",
                                recipe, components));
}

void throw_no_events(std::uint64_t steps)
{
    refuse_training(fmt::format(
        "{} steps of runs hold no event; start elsewhere, or make the runs longer", steps));
}

void throw_no_bounds()
{
    refuse_training(
        "a level gate is for a system that declares a speed_bound, and this one does not");
}

void throw_wrong_bound(std::size_t guard, double since, double then, double t, double value,
                       double allowed)
{
    refuse_training(
        t > since ? fmt::format("guard {} went from {} at {} s to {} at {} s, where its declared "
                                "bounds allow a change of {}",
                                guard, then, since, value, t, allowed)
                  : fmt::format("guard {} is {} at {} s, where its declared bound is {}", guard,
                                value, t, allowed));
}

double processor_seconds() noexcept
{
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

}  // namespace detail

}  // namespace ricochet::learn
