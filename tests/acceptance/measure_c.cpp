// Cost of the interface for C: runs by callbacks beside the same runs of C++ systems.
#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "measure.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/ricochet.h"
#include "ricochet/systems/bouncing_ball.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

extern "C" {

int c_ball_flow(void* user, rc_mode, double, const double* x, double* dxdt, size_t)
{
    dxdt[0] = x[1];
    dxdt[1] = -static_cast<const double*>(user)[0];
    return 0;
}
int c_ball_guard(void*, size_t, rc_mode, double, const double* x, size_t, double* g)
{
    *g = x[0];
    return 0;
}
int c_ball_rate(void*, size_t, rc_mode, double, const double*, const double* dxdt, size_t,
                double* rate)
{
    *rate = dxdt[0];
    return 0;
}
int c_ball_reset(void* user, size_t, rc_mode*, double, double* x, size_t)
{
    x[0] = 0;
    x[1] *= -static_cast<const double*>(user)[1];
    return 0;
}
int c_ball_rest(void*, size_t, rc_mode*, double, double* x, size_t)
{
    x[0] = x[1] = 0;
    return 0;
}

int c_rotations_flow(void*, rc_mode, double, const double* x, double* dxdt, size_t n)
{
    for (size_t i = 0; i < n; i += 2) {
        dxdt[i] = x[i + 1];
        dxdt[i + 1] = -x[i];
    }
    return 0;
}
}

void require(rc_status status)
{
    if (status != RC_OK) throw std::runtime_error(rc_last_error());
}

struct FreesSystem {
    void operator()(rc_system* system) const noexcept { rc_system_free(system); }
};
using CSystem = std::unique_ptr<rc_system, FreesSystem>;

CSystem c_system(const rc_callbacks& callbacks)
{
    rc_system* system = nullptr;
    require(rc_system_new(&callbacks, &system));
    return CSystem(system);
}

rc_options c_options(double t_end)
{
    rc_options options;
    require(rc_options_default(&options, sizeof options));
    options.t_end = t_end;
    return options;
}

/// A whole run: the state at its end, and its counts.
struct Ended {
    std::vector<double> x;
    std::size_t events = 0;
    std::uint64_t steps = 0;
};
Ended run_in_c(const rc_system* system, const std::vector<double>& x0, const rc_options& options)
{
    rc_simulation* simulation = nullptr;
    require(rc_simulation_new(system, x0.data(), x0.size(), &options, &simulation));
    require(rc_run(simulation));
    rc_statistics counts;
    counts.size = sizeof counts;
    require(rc_get_statistics(simulation, &counts));
    const double* x = rc_state(simulation);
    Ended ended{{x, x + x0.size()}, rc_event_count(simulation), counts.steps};
    require(rc_simulation_free(simulation));
    return ended;
}

struct Rotations {
    using State = std::vector<double>;
    void flow(double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); i += 2) {
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = -x[i];
        }
    }
};

/// Time of the run in C over that in C++; fails unless both end in the same bits.
template <class System, class X>
double ratio(const char* what, const System& system, const X& x0, const Options& options,
             const rc_system* in_c, const rc_options& options_in_c,
             std::vector<std::string>& details)
{
    const auto ours = [=] { return integrate(system, x0, options); };
    const std::vector<double> start(x0.begin(), x0.end());
    const auto theirs = [=] { return run_in_c(in_c, start, options_in_c); };
    const auto run = ours();
    const Ended ended = theirs();
    if (ended.x != std::vector<double>(run.x.begin(), run.x.end()) ||
        ended.events != run.events.size() || ended.steps != run.statistics.steps) {
        throw std::runtime_error(fmt::format("{}: the runs in C and in C++ differ", what));
    }
    const auto timings = time_in_turns(std::vector<Work>{repeated(ours), repeated(theirs)},
                                       {.budget = 3, .fewest = 21, .most = 501});
    const double ratio = timings[1].median / timings[0].median;
    details.push_back(fmt::format("{}: {:.2f} us in C, {:.2f} us in C++, {} steps, ratio {:.2f}",
                                  what, 1e6 * timings[1].median, 1e6 * timings[0].median,
                                  ended.steps, ratio));
    return ratio;
}

Measured time_callbacks()
{
    Measured out;
    double ball[2] = {9.81, 0.9};
    rc_callbacks callbacks{};
    callbacks.size = sizeof callbacks;
    callbacks.dimension = 2;
    callbacks.guard_count = 1;
    callbacks.user = ball;
    rc_guard_info floor{};
    floor.size = sizeof floor;
    floor.unilateral = 1;
    callbacks.guard_infos = &floor;
    callbacks.flow = c_ball_flow;
    callbacks.guard = c_ball_guard;
    callbacks.guard_rate = c_ball_rate;
    callbacks.reset = c_ball_reset;
    callbacks.rest = c_ball_rest;
    const CSystem c_ball = c_system(callbacks);
    const BouncingBall cpp_ball;
    const BouncingBall::State start{10, 0};
    const double impacts =
        ratio("ball", cpp_ball, start, {.t_end = 20.5}, c_ball.get(), c_options(20.5), out.details);
    rc_options short_steps = c_options(20.5);
    short_steps.h_max = 0.01;
    ratio("ball, steps of 0.01 s", cpp_ball, start, {.t_end = 20.5, .h_max = 0.01}, c_ball.get(),
          short_steps, out.details);

    rc_callbacks rotations{};
    rotations.size = sizeof rotations;
    rotations.dimension = 200;
    rotations.flow = c_rotations_flow;
    const CSystem c_rotations = c_system(rotations);
    std::vector<double> x0(200);
    for (std::size_t i = 0; i < x0.size(); ++i) x0[i] = 1.0 / static_cast<double>(1 + i % 7);
    const double large = ratio("100 oscillators", Rotations{}, x0, {.t_end = 20}, c_rotations.get(),
                               c_options(20), out.details);
    out.pass = impacts <= 2.2 && large <= 1.2;
    out.text = fmt::format("ball {:.2f}, 100 oscillators {:.2f}", impacts, large);
    return out;
}

}  // namespace

std::vector<Check> c_checks()
{
    return {
        {.topic = "c",
         .id = "callbacks",
         .sentence = "time of a run by callbacks from C over that of the C++ template, same bits",
         .target = "ball <= 2.2, 100 oscillators <= 1.2",
         .run = time_callbacks}};
}

}  // namespace ricochet::bench
