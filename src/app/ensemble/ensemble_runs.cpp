#include "ensemble_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "../input.hpp"
#include "base/read_file.hpp"
#include "ricochet/ensemble.hpp"
#include "ricochet/run.hpp"

namespace ricochet::app {

static_assert(block_rows == ensemble_chunk);  // so a chunk of a share is a block

namespace {

/// @throws BadInput for an option that is set both for all rows and in each
void check_options(const RunRequest& request, const Column& column)
{
    const std::array<bool, 7> given{
        request.t_start.has_value(),  request.t_end.has_value(),
        request.rtol.has_value(),     request.atol.has_value(),
        request.step.has_value(),     request.event_tolerance.has_value(),
        request.max_steps.has_value()};
    if (column.index >= given.size() || !given[column.index]) return;
    throw BadInput(fmt::format("--{} is given, and there is a column of it", column.name));
}

/// @throws BadInput for a parameter that is set both for all rows and in each, or on which a model
///         depends.
void check_columns(const SystemEntry& system, const RunRequest& request,
                   const RunSettings& settings, const Table& table)
{
    const Model* model = settings.network ? &settings.network->model()
                         : settings.gate  ? &*settings.gate
                                          : nullptr;
    for (const Column& column : table.columns) {
        if (column.is_option) check_options(request, column);
        if (!column.parameter) continue;
        const std::string name(system.parameters[column.index].name);
        for (const std::string& text : request.set) {
            if (!text.starts_with(name + '=')) continue;
            throw BadInput(
                fmt::format("{} of {} is set twice: by --set and by a column", name, system.name));
        }
        if (model == nullptr) continue;
        for (const auto& [parameter, trained] : model->parameters) {
            if (parameter != name) continue;
            throw BadInput(
                fmt::format("model '{}' is trained for {} = {}; expected no column of it",
                            settings.model.string(), name, trained));
        }
    }
}

Json settings_json(const SystemEntry& system, const RunSettings& settings, bool mode_follows)
{
    const Options& o = settings.options;
    Json out{{"t_start", o.t_start},
             {"t_end", o.t_end},
             {"stepper", settings.stepper.name()},
             {"step", o.step},
             {"rtol", o.rtol},
             {"atol", o.atol},
             {"event_tolerance", o.event_tolerance},
             {"max_steps", o.max_steps},
             {"detector", name(settings.detector)},
             {"locator", name(settings.locator)}};
    if (!system.modes.empty() && !mode_follows) out["mode"] = system.modes.at(o.mode);
    if (settings.set_valued) {
        out["integrator"] = settings.set_valued->integrator;
        out["controller"] = settings.set_valued->controller;
        out["set_valued_step"] = settings.set_valued->step;
    }
    if (!settings.model.empty()) {
        const std::string bytes =
            ricochet::detail::read_file(settings.model, [&](const std::string& why) {
                throw BadInput(fmt::format("model '{}': {}", settings.model.string(), why));
            });
        out["model"] =
            fmt::format("{} {:016x}", settings.model.filename().string(), checksum(bytes));
    }
    return out;
}

std::vector<Field> fields_of(const SystemEntry& system, const Table& table, std::size_t events)
{
    using enum FieldKind;
    std::vector<Field> out{{.name = "row", .unit = "", .kind = count}};
    for (const Column& column : table.columns) {
        out.push_back({.name = column.name, .unit = column.unit});
    }
    out.push_back({.name = "outcome", .unit = "", .kind = text, .width = outcome_width});
    out.push_back({.name = "t_final", .unit = "s"});
    for (const Component& component : system.state) {
        out.push_back(
            {.name = fmt::format("{}_final", component.name), .unit = std::string(component.unit)});
    }
    if (!system.modes.empty()) {
        std::size_t width = 1;
        for (const std::string_view mode : system.modes) width = std::max(width, mode.size());
        out.push_back({.name = "mode_final", .unit = "", .kind = text, .width = width});
    }
    for (const char* name : {"events", "steps", "rejected", "flow_calls", "guard_calls"}) {
        out.push_back({.name = name, .unit = "", .kind = count});
    }
    add_event_fields(events, out);
    out.push_back({.name = "message", .unit = "", .kind = text});
    return out;
}

}  // namespace

void add_event_fields(std::size_t events, std::vector<Field>& fields)
{
    for (std::size_t k = 1; k <= events; ++k) {
        fields.push_back({.name = fmt::format("event_{}", k), .unit = "s"});
    }
}

EnsembleRuns::EnsembleRuns(const SystemEntry& system, const RunRequest& request, Table table,
                           std::size_t events)
    : system_(system),
      settings_(resolve(system, request)),
      table_(std::move(table)),
      events_(events)
{
    check_columns(system, request, settings_, table_);
    validate(settings_.options, settings_.fixed_step);
    settings_.options.record_events = events > 0;
    sets_options_ = std::ranges::any_of(table_.columns, &Column::is_option);
    mode_follows_ = !request.mode && system.start_mode != nullptr;
}

Json EnsembleRuns::setup(std::size_t shares) const
{
    Json parameters = Json::object();
    for (std::size_t i = 0; i < system_.parameters.size(); ++i) {
        const bool varies =
            std::any_of(table_.columns.begin(), table_.columns.end(),
                        [i](const Column& c) { return c.parameter && c.index == i; });
        if (!varies) parameters[std::string(system_.parameters[i].name)] = settings_.parameters[i];
    }
    // Where there is one share, the order of its rows is that of format 1.
    return {{"format", shares == 1 ? 1 : 2},
            {"ricochet", RICOCHET_VERSION},
            {"system", system_.name},
            {"columns", names_and_units(table_.columns)},
            {"rows", table_.rows},
            {"table", table_.identity},
            {"parameters", std::move(parameters)},
            {"settings", settings_json(system_, settings_, mode_follows_)},
            {"fields", to_json(fields_of(system_, table_, events_))}};
}

void EnsembleRuns::put_inputs(std::size_t row, RowWriter& out) const
{
    out.count(row);
    for (std::size_t i = 0; i < table_.columns.size(); ++i) out.number(table_.value(row, i));
}

void EnsembleRuns::put_failure(std::size_t row, std::string_view message, std::string& out) const
{
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    RowWriter writer(out);
    put_inputs(row, writer);
    writer.text(failed_row);
    writer.number(none);
    for (std::size_t i = 0; i < system_.state.size(); ++i) writer.number(none);
    if (!system_.modes.empty()) writer.text("");
    for (int i = 0; i < 5; ++i) writer.count(0);
    for (std::size_t k = 0; k < events_; ++k) writer.number(none);
    writer.text(message);
}

void EnsembleRuns::set_option(const Column& column, double value, Options& options)
{
    const std::array<double*, 6> numbers{&options.t_start, &options.t_end,
                                         &options.rtol,    &options.atol,
                                         &options.step,    &options.event_tolerance};
    if (column.index < numbers.size()) {
        *numbers[column.index] = value;
    } else if (column.name == "max-steps") {
        if (!(value >= 1) || !(value < 1e18) || value != std::floor(value)) {
            throw BadInput(
                fmt::format("max-steps must be a whole number from 1 on, got {}", value));
        }
        options.max_steps = static_cast<std::uint64_t>(value);
    }
}

void EnsembleRuns::run_row(std::size_t row, std::string& out) const
{
    const std::size_t before = out.size();
    try {
        RunSettings settings = settings_;
        for (std::size_t i = 0; i < table_.columns.size(); ++i) {
            const Column& column = table_.columns[i];
            const double value = table_.value(row, i);
            if (column.is_option) set_option(column, value, settings.options);
            if (!column.parameter) continue;
            columns_of(system_).check(column, value, "this row");
            settings.parameters[column.index] = value;
        }
        if (sets_options_) validate(settings.options, settings_.fixed_step);
        for (std::size_t i = 0; i < table_.columns.size(); ++i) {
            const Column& column = table_.columns[i];
            if (column.parameter || column.is_option) continue;
            if (settings.start.empty()) settings.start = system_.start(settings.parameters);
            settings.start.at(column.index) = table_.value(row, i);
        }
        if (mode_follows_) settings.options.mode = system_.start_mode(settings.parameters);
        const auto run = system_.run(settings, 1).run;
        RowWriter writer(out);
        put_inputs(row, writer);
        writer.text(ricochet::name(run.outcome));
        writer.number(run.t);
        for (std::size_t i = 0; i < system_.state.size(); ++i) writer.number(run.x.at(i));
        if (!system_.modes.empty()) writer.text(system_.modes.at(run.mode));
        const Statistics& s = run.statistics;
        for (const std::uint64_t count :
             {s.events, s.steps, s.rejected, s.flow_calls, s.guard_calls}) {
            writer.count(count);
        }
        for (std::size_t k = 0; k < events_; ++k) {
            writer.number(k < run.events.size() ? run.events[k].t
                                                : std::numeric_limits<double>::quiet_NaN());
        }
        writer.text("");
    } catch (const std::exception& error) {
        out.resize(before);
        put_failure(row, error.what(), out);
    }
}

void EnsembleTally::add(const std::vector<Field>& fields, std::string_view rows)
{
    for (RowReader reader(rows); !reader.is_at_end();) {
        std::uint64_t row = 0;
        std::string_view outcome;
        for (const Field& field : fields) {
            if (field.kind == FieldKind::number) {
                (void)reader.number();
            } else if (field.kind == FieldKind::count) {
                const std::uint64_t value = reader.count();
                if (field.name == "row") row = value;
                if (field.name == "events") events += value;
            } else {
                const std::string_view text = reader.text();
                if (field.name == "outcome") outcome = text;
                const bool first = first_failure.empty() || row < failed_row_;
                if (field.name != "message" || text.empty() || !first) continue;
                failed_row_ = row;
                first_failure = fmt::format("row {}: {}", row, text);
            }
        }
        ++outcomes[std::string(outcome)];
    }
}

}  // namespace ricochet::app
