// Results of a run of a scene: as text, JSON and comma-separated values.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>

#include "../input.hpp"
#include "../interrupt.hpp"
#include "../joined.hpp"
#include "../json_text.hpp"
#include "scene_command.hpp"

namespace ricochet::app {

namespace {

constexpr std::size_t most_lines = 40;

std::string_view name(SceneEvent::Kind kind)
{
    switch (kind) {
        case SceneEvent::Kind::impact: return "impact";
        case SceneEvent::Kind::held: return "held";
        case SceneEvent::Kind::stopped: return "stopped";
        case SceneEvent::Kind::joined: return "joined";
        case SceneEvent::Kind::released: return "released";
        case SceneEvent::Kind::slept: return "slept";
    }
    return "";
}

bool has_other(const SceneEvent& event)
{
    return event.other.is_surface || event.other.index != event.body;
}

std::string other_of(const Scene& scene, const SceneEvent& event)
{
    if (!has_other(event)) return "";
    return event.other.is_surface ? scene.name_of(SurfaceId{event.other.index})
                                  : scene.name_of(BodyId{event.other.index});
}

bool is_periodic(const Scene& scene)
{
    return scene.settings().period != Vector2{};
}

Json state_of(const Scene& scene, std::uint32_t i, const BodyState& state,
              const std::vector<BodyTurn>& turns)
{
    Json out{{"name", scene.name_of(BodyId{i})},
             {"at", state.at},
             {"velocity", state.velocity},
             {"asleep", state.asleep}};
    if (is_periodic(scene)) out["winding"] = state.winding;
    if (!turns.empty()) {
        out["angle"] = turns[i].angle;
        out["spin"] = turns[i].spin;
    }
    return out;
}

Json states_of(const Scene& scene, const std::vector<BodyState>& states,
               const std::vector<BodyTurn>& turns)
{
    Json all = Json::array();
    for (std::uint32_t i = 0; i < states.size(); ++i) {
        all.push_back(state_of(scene, i, states[i], turns));
    }
    return all;
}

Json event_of(const Scene& scene, const SceneEvent& event)
{
    Json out{{"t", event.t},
             {"number", event.number},
             {"kind", name(event.kind)},
             {"body", scene.name_of(BodyId{event.body})}};
    if (!has_other(event)) return out;
    out["other"] = other_of(scene, event);
    out["impulse"] = event.impulse;
    if (event.kind == SceneEvent::Kind::impact) {
        out["at"] = event.at;
        out["normal"] = event.normal;
    }
    out["before"] = event.before[0];
    out["after"] = event.after[0];
    if (!event.other.is_surface) {
        out["other_before"] = event.before[1];
        out["other_after"] = event.after[1];
    }
    return out;
}

}  // namespace

std::string scene_text(const SceneFile& file, const SceneRun& run)
{
    fmt::memory_buffer out;
    const auto to = std::back_inserter(out);
    const std::size_t lines = std::min(run.events.size(), most_lines);
    for (std::size_t k = 0; k < lines; ++k) {
        const SceneEvent& event = run.events[k];
        const std::string other = other_of(file.scene, event);
        fmt::format_to(to, "{:<22} {:<9} {}{}{}\n", event.t, name(event.kind),
                       printable(file.scene.name_of(BodyId{event.body})), other.empty() ? "" : ", ",
                       printable(other));
    }
    if (run.events.size() > lines) {
        fmt::format_to(to, "and {} more; --json has all\n", run.events.size() - lines);
    }
    const auto asleep = std::ranges::count_if(run.bodies, &BodyState::asleep);
    const SceneStatistics& s = run.statistics;
    fmt::format_to(to, "{} at t = {} s{}{}\n", ricochet::name(run.outcome), run.t,
                   run.message.empty() ? "" : ": ", run.message);
    if (run.outcome == Outcome::cancelled) {
        fmt::format_to(to, "  incomplete: {}\n", Interrupts::cause());
    }
    fmt::format_to(to, "asleep      {} of {} bodies\n", asleep, run.bodies.size());
    fmt::format_to(to, "events      {}, {} contacts struck, {} collapses\n", s.events, s.impacts,
                   s.collapses);
    fmt::format_to(to, "steps       {} of springs and drag, {} of lasting contact\n", s.steps,
                   s.contact_steps);
    fmt::format_to(to, "energy      {} J\n", energy(file.scene, run.bodies, run.turns));
    return fmt::to_string(out);
}

void PrintedEvents::begin()
{
    if (!std::exchange(begun_, true)) text_ += "{\n  \"events\": [";
}

void PrintedEvents::add(const SceneEvent& event)
{
    constexpr std::size_t together = 1 << 18;  // bytes
    begin();
    text_ += std::exchange(any_, true) ? ",\n    " : "\n    ";
    text_ += event_of(scene_, event).dump(-1, ' ', false, Json::error_handler_t::replace);
    if (text_.size() < together) return;
    print(text_);
    text_.clear();
}

void PrintedEvents::end()
{
    begin();
    text_ += any_ ? "\n  ],\n" : "],\n";
    print(std::exchange(text_, {}));
}

std::string scene_json(const SceneFile& file, const SceneRun& run, bool samples, bool begun)
{
    const Scene& scene = file.scene;
    Json out{{"outcome", ricochet::name(run.outcome)}, {"message", run.message}, {"t", run.t}};
    if (run.outcome == Outcome::cancelled) out["incomplete"] = Interrupts::cause();
    out["involved"] = Json::array();
    for (const std::uint32_t i : run.involved) out["involved"].push_back(scene.name_of(BodyId{i}));
    out["energy"] = energy(scene, run.bodies, run.turns);
    out["bodies"] = states_of(scene, run.bodies, run.turns);
    if (samples) {
        out["samples"] = Json::array();
        for (std::size_t k = 0; k < run.samples.size(); ++k) {
            const auto& turns = run.turns.empty() ? run.turns : run.sample_turns[k];
            out["samples"].push_back(
                {{"t", run.sample_times[k]}, {"bodies", states_of(scene, run.samples[k], turns)}});
        }
    }
    const SceneStatistics& s = run.statistics;
    out["statistics"] = {{"events", s.events},
                         {"impacts", s.impacts},
                         {"waves", s.waves},
                         {"collapses", s.collapses},
                         {"predictions", s.predictions},
                         {"steps", s.steps},
                         {"contact_steps", s.contact_steps},
                         {"crowded_steps", s.crowded_steps},
                         {"crowded_rebounds", s.crowded_rebounds},
                         {"contact_defect", s.contact_defect},
                         {"joins", s.joins},
                         {"alone", s.alone},
                         {"groups", s.groups}};
    // Without the brace that `PrintedEvents` has printed.
    return begun ? json_text(out).substr(2) : json_text(out);
}

std::string scene_csv(const SceneFile& file, const SceneRun& run)
{
    fmt::memory_buffer out;
    const auto to = std::back_inserter(out);
    const bool periodic = is_periodic(file.scene);
    fmt::format_to(to, "t,body,x,y,vx,vy,asleep{}{}\n", periodic ? ",winding_x,winding_y" : "",
                   run.turns.empty() ? "" : ",angle,spin");
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
        for (std::uint32_t i = 0; i < run.samples[k].size(); ++i) {
            const BodyState& b = run.samples[k][i];
            fmt::format_to(to, "{},{},{},{},{},{},{}", run.sample_times[k],
                           csv_cell(file.scene.name_of(BodyId{i})), b.at[0], b.at[1], b.velocity[0],
                           b.velocity[1], static_cast<int>(b.asleep));
            if (periodic) fmt::format_to(to, ",{},{}", b.winding[0], b.winding[1]);
            if (!run.turns.empty()) {
                const BodyTurn& turn = run.sample_turns[k][i];
                fmt::format_to(to, ",{},{}", turn.angle, turn.spin);
            }
            fmt::format_to(to, "\n");
        }
    }
    if (run.outcome == Outcome::cancelled) fmt::format_to(to, "{}", incomplete_line());
    return fmt::to_string(out);
}

}  // namespace ricochet::app
