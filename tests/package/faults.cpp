// A user of the component `faults`: an earthquake of the slider.
#include <cstdio>

#include "ricochet/faults/spring_slider.hpp"

int main()
{
    const ricochet::RateStateParameters rock;
    ricochet::SpringSlider slider;
    slider.block.stiffness = 0.5 * ricochet::critical_stiffness(rock, 1, 9.81, 1.5e-4);
    slider.load = {9.81 * rock.f_star / slider.block.stiffness, 1.5e-4};
    const auto run =
        ricochet::run_slider(slider, {.v = rock.v_star}, {.t_end = 1, .threshold = 1e-3});
    std::puts(run.events.empty() ? "no event" : "fine");
    return run.events.empty() ? 1 : 0;
}
