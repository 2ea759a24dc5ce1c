// A ball in a cavern whose wall has ten thousand segments: a guard that is dear, and bounds
// that say when it need not be asked.

#include <cstdio>

#include "ricochet/ricochet.hpp"
#include "problems/cavern.hpp"

int main()
{
    using namespace ricochet;
    const Cavern cavern({.segments = 10'000});
    const Options options{.t_end = 20, .step = 1e-3};
    const FixedStep<Rk4> rk4;
    const auto looked = integrate(cavern, cavern.start(), options, rk4, Extremum{});
    const auto planned = integrate(cavern, cavern.start(), options, rk4, Planned{});

    std::printf("%zu impacts in %g s and %llu steps\n", planned.events.size(), planned.t,
                static_cast<unsigned long long>(planned.statistics.steps));
    const auto calls = [](const auto& run) {
        return static_cast<unsigned long long>(run.statistics.guard_calls);
    };
    std::printf("distances to the wall: %llu at every step, %llu planned\n", calls(looked),
                calls(planned));
    bool same = looked.events.size() == planned.events.size();
    for (std::size_t i = 0; same && i < looked.events.size(); ++i) {
        same = looked.events[i].t == planned.events[i].t;
    }
    std::printf("impacts at %s times\n", same ? "the same" : "OTHER");
    return same && calls(planned) * 10 < calls(looked) ? 0 : 1;
}
