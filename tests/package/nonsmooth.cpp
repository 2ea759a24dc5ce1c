// A user of the component `nonsmooth`: a relay, by events and by set-valued steps.
#include <cmath>
#include <cstdio>

#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/systems/sliding_mode.hpp"

int main()
{
    using ricochet::SlidingMode;
    const SlidingMode relay({.amplitude = 1.75, .frequency = 50, .gain = 2});
    const SlidingMode::Vector start = SlidingMode::Vector::Constant(SlidingMode::start);
    const auto run = ricochet::integrate(relay, start, {.t_end = SlidingMode::t_end});
    const bool held = std::abs(run.x[0]) < 1e-9;
    std::puts(held ? "fine" : "not held");
    return held ? 0 : 1;
}
