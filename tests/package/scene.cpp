// A user of the component `scene`: two discs on a line exchange their velocities.
#include <cmath>
#include <cstdio>

#include "ricochet/scene/simulate.hpp"

int main()
{
    const ricochet::SceneFile file = ricochet::read_scene(R"({
        "bodies": [{"disc": {"radius": 0.5}, "at": [0, 0], "velocity": [1, 0]},
                   {"disc": {"radius": 0.5}, "at": [3, 0]}],
        "run": {"t_end": 3}})");
    const ricochet::SceneRun run = ricochet::simulate(file.scene, file.options);
    const bool fine = run.events.size() == 1 && std::fabs(run.events[0].t - 2) < 1e-14;
    std::puts(fine ? "fine" : "they did not meet");
    return fine ? 0 : 1;
}
