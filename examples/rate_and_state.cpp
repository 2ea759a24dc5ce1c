// Stick-slip with rate-and-state friction, by steps that always have a solution.
//
// The ageing law has an exact pair of potentials, so that an implicit step minimises a function. It
// is convex for small steps, and has a minimum for any step.

#include <cmath>
#include <cstdio>

#include "ricochet/faults/spring_slider.hpp"

int main()
{
    const ricochet::RateStateParameters rock;  // a = 0.011, b = 0.016: weakening
    const double load_velocity = 1.5e-4;       // [m/s]

    // Friction and rate of the state, and the same from the potentials.
    const ricochet::AgeingPotential<> pair(rock);
    const auto law = pair.law().evaluate(2e-4, 0.3);
    const auto potentials = ricochet::evaluate(pair, 2e-4, 0.3);
    std::printf("f = %.12f and dDdag/dV = %.12f, xi' = %.6f and dD*/dd = %.6f 1/s\n", law.friction,
                potentials.friction, law.rate, potentials.rate);

    // A block of 1 kg on a spring with half the stiffness at which steady sliding becomes stable.
    ricochet::SpringSlider slider;
    slider.block.stiffness = 0.5 * ricochet::critical_stiffness(rock, 1, 9.81, load_velocity);
    slider.load = {9.81 * rock.f_star / slider.block.stiffness, load_velocity};
    std::printf("one minimum for every step up to %.2f ms\n",
                1e3 * ricochet::largest_convex_step(rock, slider.block));

    const ricochet::SliderState start{.v = rock.v_star};
    const auto run = ricochet::run_slider(slider, start, {.t_end = 1, .threshold = 1e-3});
    for (const auto& event : run.events) {
        std::printf("%.6f s: %s, slipped %.3f mm\n", event.at.t, ricochet::name(event.kind).data(),
                    1e3 * event.at.x);
    }

    // Steps a thousand times as long: inaccurate, but solved, and at rest in between.
    const auto coarse = ricochet::run_slider(slider, start, {.t_end = 1000, .order = 2, .step = 1});
    std::printf("%zu steps of 1 s: %zu stages unsolved, mean slip rate %.3g m/s\n", coarse.steps,
                coarse.unsolved, coarse.state.x / coarse.state.t);

    const bool same = std::abs(law.friction - potentials.friction) < 1e-14 &&
                      std::abs(law.rate - potentials.rate) < 1e-9;
    return same && run.events.size() > 4 && coarse.unsolved == 0 ? 0 : 1;
}
