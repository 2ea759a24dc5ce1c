// A controller that samples a plant and acts a little later, until the plant has settled.
//
// The clock is known beforehand, the delay is a timer in the state that each sample starts: one
// function says which of them comes next. The run has no end of its own: the reset ends it, and
// `max_steps` if it never does.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "ricochet/ricochet.hpp"

struct SampledController {
    // The plant's output, what acts on it, the result that is being computed, and when it is ready.
    enum : std::size_t { plant, held, computed, due };
    using State = std::array<double, 4>;
    static constexpr double never = 1e9;  // [s] a state is finite

    double target = 1;
    double gain = 4;
    double delay = 0.03;  // [s] between a sample and its effect
    ricochet::Times ticks = ricochet::every(0.1);

    void flow(double, const State& x, State& dxdt) const { dxdt = {x[held] - x[plant], 0, 0, 0}; }

    double next_time_event(double t, const State& x) const
    {
        return std::min(ticks.next(t), x[due]);
    }

    void time_reset(double t, State& x) const
    {
        if (x[due] <= t) {
            x[held] = x[computed];
            x[due] = never;
        }
        if (ticks.count(t) > 0) {
            const double result = gain * (target - x[plant]);
            const bool settled = std::fabs(result - x[held]) < 1e-6;
            x[computed] = result;
            x[due] = t + delay;
            if (settled) throw ricochet::StopRun("the plant has settled");
        }
    }
};

int main()
{
    const SampledController controller;
    const auto run = ricochet::integrate(
        controller, {0, 0, 0, 0},
        {.t_end = std::numeric_limits<double>::infinity(), .rtol = 1e-10, .max_steps = 1'000'000});
    std::printf("%s at %.1f s: output %.6f after %zu events\n", run.reason.c_str(), run.t,
                run.x[SampledController::plant], run.events.size());
    // Proportional control leaves the error target / (1 + gain).
    const double expected = controller.target * controller.gain / (1 + controller.gain);
    return std::fabs(run.x[SampledController::plant] - expected) < 1e-5 ? 0 : 1;
}
