// A ball in a cavern whose wall has ten thousand segments: a guard that is dear, and bounds
// that say when it need not be asked.

#include <cmath>
#include <cstdio>

#include "ricochet/ricochet.hpp"

int main()
{
    const ricochet::Cavern cavern({.segments = 10'000});
    const double t_end = 20;
    ricochet::Options options{.t_end = t_end, .step = 1e-3};
    for (int i = 0; i <= 2000; ++i) options.sample_times.push_back(t_end * i / 2000);
    const auto run = ricochet::integrate(cavern, cavern.start(), options,
                                         ricochet::FixedStep<ricochet::Rk4>{}, ricochet::Ends{});

    // Along the motion: how many of the next steps cannot meet the wall, whatever its shape?
    // The way in a time tau is at most v tau + a tau^2 / 2.
    double free_steps = 0;
    for (std::size_t i = 0; i < run.trajectory.t.size(); ++i) {
        const auto& x = run.trajectory.x[i];
        const double t = run.trajectory.t[i];
        const double v = cavern.speed_bound(t, x);
        const double a = cavern.acceleration_bound(t, x);
        const double room = std::fmax(cavern.guard(t, x), 0.0);
        free_steps += (std::sqrt(v * v + 2 * a * room) - v) / a / options.step;
    }
    std::printf("%zu impacts in %g s and %llu steps\n", run.events.size(), run.t,
                static_cast<unsigned long long>(run.statistics.steps));
    std::printf("after a look at the wall the next %.0f steps are free of impacts, on average\n",
                free_steps / static_cast<double>(run.trajectory.t.size()));
    return run.outcome == ricochet::Outcome::reached_end && run.events.size() > 5 ? 0 : 1;
}
