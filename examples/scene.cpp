// A break on a billiard table: fifteen balls in a rack, and their motion after one stroke.
#include <cmath>
#include <cstdio>

#include "ricochet/scene/simulate.hpp"

int main()
{
    using namespace ricochet;
    const double radius = 0.028575;  // [m]
    const double length = 2.54;
    const double width = 1.27;
    Scene table;
    const MaterialId ivory = table.material({.name = "ivory", .restitution = 0.95});
    const MaterialId rubber = table.material({.name = "rubber", .restitution = 0.8});
    table.wall({.name = "near", .point = {0, 0}, .normal = {0, 1}, .material = rubber});
    table.wall({.name = "left", .point = {0, 0}, .normal = {1, 0}, .material = rubber});
    table.wall({.name = "far", .point = {length, width}, .normal = {0, -1}, .material = rubber});
    table.wall({.name = "right", .point = {length, width}, .normal = {-1, 0}, .material = rubber});
    const BodyId cue = table.disc({.name = "cue",
                                   .at = {0.6, width / 2},
                                   .velocity = {7, 0.1},
                                   .radius = radius,
                                   .mass = 0.17,
                                   .material = ivory});
    for (int row = 0; row < 5; ++row) {
        for (int k = 0; k <= row; ++k) {
            table.disc(
                {.at = {1.9 + row * radius * std::sqrt(3.0), width / 2 + (2 * k - row) * radius},
                 .radius = radius,
                 .mass = 0.17,
                 .material = ivory});
        }
    }
    const SceneOptions options{.t_end = 3};
    std::puts(explain(table, options).c_str());
    const SceneRun run = simulate(table, options);
    const SceneEvent& first = run.events.front();
    std::printf("the cue ball meets the rack after %.12f s\n", first.t);
    std::printf("%zu contacts in %.0f s; the cue ball ends at (%.3f, %.3f)\n", run.events.size(),
                run.t, run.bodies[cue.index].at[0], run.bodies[cue.index].at[1]);
    return run.outcome == Outcome::reached_end ? 0 : 1;
}
