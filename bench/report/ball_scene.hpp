// One ball or N balls of a task as a scene.
#pragma once

#include <cstddef>

#include "problems.hpp"
#include "ricochet/scene/scene.hpp"

namespace ricochet::report {

/// The balls of a task as points above a floor, side by side.
template <class System>
[[nodiscard]] Scene scene_of(const Task<System>& task)
{
    Scene scene({.gravity = {0, -9.81}});
    const MaterialId rubber = scene.material({.name = "rubber", .restitution = 0.9});
    scene.wall({.point = {0, 0}, .normal = {0, 1}, .material = rubber});
    for (std::size_t i = 0; 2 * i < task.x0.size(); ++i) {
        scene.point({.at = {static_cast<double>(i), task.x0[2 * i]}, .material = rubber});
    }
    return scene;
}

}  // namespace ricochet::report
