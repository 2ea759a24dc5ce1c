#include "scene_runs.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <utility>

#include "../input.hpp"
#include "../interrupt.hpp"
#include "../joined.hpp"
#include "base/read_file.hpp"
#include "base/strict_json.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::app {

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// The states of so many bodies are results; those of more are not.
constexpr std::size_t most_bodies = 64;
constexpr int deepest = 8;

struct RunOption {
    std::string_view name;
    std::string_view key;  ///< in "run"; empty: none
    std::string_view unit;
};
constexpr std::array<RunOption, 8> run_options{{{"t-start", "t_start", "s"},
                                                {"t-end", "t_end", "s"},
                                                {"rtol", "rtol", ""},
                                                {"atol", "atol", ""},
                                                {"contact-step", "contact_step", "s"},
                                                {"max-events", "max_events", ""},
                                                {"seed", "seed", ""},
                                                {"id", "", ""}}};

std::vector<std::string> path_parts(std::string_view name)
{
    std::vector<std::string> parts;
    for (;;) {
        const std::size_t dot = name.find('.');
        parts.emplace_back(name.substr(0, dot));
        if (dot == name.npos) return parts;
        name.remove_prefix(dot + 1);
    }
}

/// The number of a member of a list: by its name, its place, or x and y.
std::optional<std::size_t> place_in(const Json& list, const std::string& part)
{
    if (part == "x" || part == "y") {
        const std::size_t axis = part == "x" ? 0 : 1;
        return list.size() == 2 ? std::optional(axis) : std::nullopt;
    }
    for (std::size_t k = 0; k < list.size(); ++k) {
        if (list[k].is_object() && list[k].value("name", std::string()) == part) return k;
    }
    std::size_t number = 0;
    const char* const end = part.data() + part.size();
    const auto [stop, error] = std::from_chars(part.data(), end, number);
    if (error != std::errc() || stop != end || number >= list.size()) return std::nullopt;
    return number;
}

/// Names of the members of a value, for messages.
std::string members_of(const Json& value)
{
    std::vector<std::string> known;
    if (value.is_object()) {
        for (const auto& item : value.items()) known.push_back(item.key());
    } else if (value.is_array()) {
        for (std::size_t k = 0; k < value.size() && k < 20; ++k) {
            const bool named = value[k].is_object() && value[k].contains("name");
            known.push_back(named ? value[k]["name"].get<std::string>() : std::to_string(k));
        }
    }
    return known.empty() ? "nothing" : joined(known, ", ");
}

bool is_pair(std::string_view key)
{
    return key == "gravity" || key == "period" || key == "velocity" || key == "at";
}

}  // namespace

SceneText::SceneText(const std::string& file, const RunRequest& request) : file_(file)
{
    const std::string text = ricochet::detail::read_file(file, [&](const std::string& why) {
        throw BadInput(fmt::format("the scene '{}' cannot be read: {}", shortened(file), why));
    });
    try {
        static_cast<void>(read_scene(text, file));
    } catch (const SceneFileError& error) {
        throw BadInput(error.what());
    }
    json_ = ricochet::detail::parse_strictly(text, deepest);
    RunRequest allowed;
    allowed.set = request.set;
    allowed.t_start = request.t_start;
    allowed.t_end = request.t_end;
    allowed.rtol = request.rtol;
    allowed.atol = request.atol;
    if (!(request == allowed)) {
        throw BadInput(
            "an ensemble of scenes takes --t-start, --t-end, --rtol, --atol and --set; "
            "expected no other option of a run");
    }
    const auto put = [&](std::string_view name, const std::optional<double>& value) {
        if (value) set(json_, column("the command line", name), *value);
    };
    put("t-start", request.t_start);
    put("t-end", request.t_end);
    put("rtol", request.rtol);
    put("atol", request.atol);
    for (const std::string& text_of : request.set) {
        const auto [name, value] = assignment("--set", text_of);
        set(json_, column("--set", name), value);
    }
}

Column SceneText::column(std::string_view where, std::string_view name) const
{
    for (const RunOption& option : run_options) {
        if (option.name != name) continue;
        return {.name = std::string(name),
                .unit = std::string(option.unit),
                .parameter = false,
                .is_option = true,
                .target = option.key.empty() ? "" : fmt::format("/run/{}", option.key)};
    }
    const auto refuse = [&](const std::string& part, const Json& in) {
        throw BadInput(fmt::format("{}: '{}' is not a number of {}: there is no '{}' among {}",
                                   where, shortened(name), file_, part, members_of(in)));
    };
    const std::vector<std::string> parts = path_parts(name);
    const Json* at = &json_;
    std::string target;
    static const Json pair = Json::array({0, 0});
    for (std::size_t k = 0; k < parts.size(); ++k) {
        const std::string& part = parts[k];
        const bool last = k + 1 == parts.size();
        if (at->is_object()) {
            target += '/' + part;
            if (at->contains(part)) {
                at = &at->at(part);
            } else if (!last && is_pair(part)) {
                at = &pair;  // it has a default
            } else if (last && k > 0) {
                return {.name = std::string(name), .unit = "", .target = target};
            } else {
                refuse(part, *at);
            }
        } else if (at->is_array()) {
            const auto place = place_in(*at, part);
            if (!place) refuse(part, *at);
            target += fmt::format("/{}", *place);
            at = &at->at(*place);
        } else {
            refuse(part, *at);
        }
    }
    if (!at->is_number()) {
        throw BadInput(fmt::format("{}: '{}' of {} is {}, expected the name of a number", where,
                                   shortened(name), file_,
                                   at->is_structured() ? "not a number; it has " + members_of(*at)
                                                       : shortened(at->dump())));
    }
    return {.name = std::string(name), .unit = "", .target = target};
}

ColumnSource SceneText::columns() const
{
    return {[this](std::string_view where, std::string_view name) { return column(where, name); },
            [](const Column&, double, std::string_view) {}};
}

void SceneText::set(Json& scene, const Column& column, double value)
{
    if (column.target.empty()) return;
    const Json::json_pointer pointer(column.target);
    if (!scene.contains(pointer.parent_pointer()) && column.target.ends_with("/0")) {
        scene[pointer.parent_pointer()] = Json::array({0, 0});
    } else if (!scene.contains(pointer.parent_pointer()) && column.target.ends_with("/1")) {
        scene[pointer.parent_pointer()] = Json::array({0, 0});
    }
    const bool whole = column.target == "/run/seed" || column.target == "/run/max_events";
    if (whole && value >= 0 && value < 0x1p53 && value == std::floor(value)) {
        scene[pointer] = static_cast<std::uint64_t>(value);
    } else {
        scene[pointer] = value;
    }
}

SceneRuns::SceneRuns(const SceneText& text, Table table, std::size_t events)
    : text_(text), table_(std::move(table)), events_(events)
{
    const SceneFile file = read_scene(text.json().dump(), text.file());
    const bool ends = std::ranges::any_of(
        table_.columns, [](const Column& column) { return column.target == "/run/t_end"; });
    if (std::isnan(file.options.t_end) && !ends) {
        throw BadInput(
            fmt::format("{} has no \"t_end\" under \"run\"; expected it, --t-end, or a "
                        "column t-end",
                        text.file()));
    }
    const auto count = static_cast<std::uint32_t>(file.scene.bodies().size());
    for (std::uint32_t i = 0; count <= most_bodies && i < count; ++i) {
        bodies_.push_back(file.scene.name_of(BodyId{i}));
    }
}

std::vector<Field> SceneRuns::fields() const
{
    using enum FieldKind;
    std::vector<Field> out{{.name = "row", .unit = "", .kind = count}};
    for (const Column& column : table_.columns) {
        out.push_back({.name = column.name, .unit = column.unit});
    }
    out.push_back({.name = "outcome", .unit = "", .kind = text, .width = outcome_width});
    out.push_back({.name = "t_final", .unit = "s"});
    for (const std::string& body : bodies_) {
        for (const auto& [what, unit] : {std::pair("x", "m"), std::pair("y", "m"),
                                         std::pair("vx", "m/s"), std::pair("vy", "m/s")}) {
            out.push_back({.name = fmt::format("{} {}_final", body, what), .unit = unit});
        }
    }
    out.push_back({.name = "energy_start", .unit = "J"});
    out.push_back({.name = "energy_final", .unit = "J"});
    for (const char* name : {"events", "impacts", "collapses", "asleep"}) {
        out.push_back({.name = name, .unit = "", .kind = count});
    }
    add_event_fields(events_, out);
    out.push_back({.name = "message", .unit = "", .kind = text});
    return out;
}

Json SceneRuns::setup(std::size_t shares) const
{
    return {{"format", shares == 1 ? 1 : 2},
            {"ricochet", RICOCHET_VERSION},
            {"system", name()},
            {"columns", names_and_units(table_.columns)},
            {"rows", table_.rows},
            {"table", table_.identity},
            {"parameters", Json::object()},
            {"settings", {{"scene", fmt::format("{:016x}", checksum(text_.json().dump()))}}},
            {"fields", to_json(fields())}};
}

void SceneRuns::put_inputs(std::size_t row, RowWriter& out) const
{
    out.count(row);
    for (std::size_t i = 0; i < table_.columns.size(); ++i) out.number(table_.value(row, i));
}

void SceneRuns::run_row(std::size_t row, std::string& out) const
{
    const std::size_t before = out.size();
    RowWriter writer(out);
    try {
        Json json = text_.json();
        for (std::size_t i = 0; i < table_.columns.size(); ++i) {
            SceneText::set(json, table_.columns[i], table_.value(row, i));
        }
        SceneFile file = read_scene(json.dump(), text_.file());
        file.options.contacts = scene_contacts();
        file.options.cancelled = Interrupts::flag();
        file.options.sample_times = {file.options.t_start};
        file.options.record_events = events_ > 0;
        const SceneRun run = simulate(file.scene, file.options);
        put_inputs(row, writer);
        writer.text(ricochet::name(run.outcome));
        writer.number(run.t);
        const Vector2 period = file.scene.settings().period;
        for (std::size_t i = 0; i < bodies_.size(); ++i) {
            const BodyState& body = run.bodies.at(i);
            for (std::size_t c = 0; c < 2; ++c) {
                writer.number(body.at[c] + body.winding[c] * period[c]);
            }
            for (const double v : body.velocity) writer.number(v);
        }
        const auto turns = run.sample_turns.empty() ? std::vector<BodyTurn>{} : run.sample_turns[0];
        writer.number(run.samples.empty() ? none : energy(file.scene, run.samples[0], turns));
        writer.number(energy(file.scene, run.bodies, run.turns));
        writer.count(run.statistics.events);
        writer.count(run.statistics.impacts);
        writer.count(run.statistics.collapses);
        std::uint64_t asleep = 0;
        for (const BodyState& body : run.bodies) asleep += body.asleep;
        writer.count(asleep);
        std::vector<double> times;
        for (const SceneEvent& event : run.events) {
            if (times.size() == events_) break;
            if (event.kind == SceneEvent::Kind::impact) times.push_back(event.t);
        }
        times.resize(events_, none);
        for (const double t : times) writer.number(t);
        writer.text(run.message);
    } catch (const std::exception& error) {
        out.resize(before);
        put_inputs(row, writer);
        writer.text(failed_row);
        for (std::size_t i = 0; i < 3 + 4 * bodies_.size(); ++i) writer.number(none);
        for (int i = 0; i < 4; ++i) writer.count(0);
        for (std::size_t k = 0; k < events_; ++k) writer.number(none);
        writer.text(error.what());
    }
}

}  // namespace ricochet::app
