// ricochet itself: one ball or N balls as a scene, each with its own time.
#include "ball_scene.hpp"
#include "cells.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::report {

namespace {

[[nodiscard]] Answer solve(const Scene& scene, double t_end)
{
    const SceneRun run = simulate(scene, {.t_end = t_end});
    Answer answer{.finished = run.outcome == Outcome::reached_end,
                  .steps = run.statistics.steps,
                  .flow_calls = run.statistics.flow_calls,
                  .note = run.message};
    for (const SceneEvent& event : run.events) {
        if (event.kind == SceneEvent::Kind::impact) answer.add(event.t, event.body);
    }
    return answer;
}

}  // namespace

void add_scene(Cells& cells)
{
    for_each_problem([&](const std::string& name, const std::string& /*title*/, const auto& make) {
        using System = decltype(std::decay_t<decltype(make())>::value_type::system);
        if constexpr (std::is_same_v<System, Balls> || std::is_same_v<System, Ball>) {
            cells.add({name, "ricochet", "scene", 0, [make] {
                           const auto task = make().front();
                           return [scene = scene_of(task), t_end = task.t_end] {
                               return solve(scene, t_end);
                           };
                       }});
        }
    });
}

}  // namespace ricochet::report
