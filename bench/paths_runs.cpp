// Paths through runs: larger states, methods by name, recorded passages, Taylor's method in lanes,
// and inclusions.
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "paths.hpp"
#include "recorded_oscillators.hpp"
#include "report/problems.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "ricochet/taylor/lanes.hpp"
#include "ricochet/taylor/taylor.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

using report::Task;
using ByName = ErrorControlled<MethodByName>;

/// A run whose result is kept.
template <class S, class Stepping = ErrorControlled<Dopri5>>
Path run(const Task<S>& task, Options options, const Stepping& stepping = {})
{
    options.t_end = task.t_end;
    return [=] {
        auto result = integrate(task.system, task.x0, options, stepping);
        keep(result);
    };
}

const Options loose{.rtol = 1e-8, .atol = 1e-8};
const Options tight{.rtol = 1e-12, .atol = 1e-12};

Task<report::Impacts> twenty_periods()
{
    return report::impact_oscillator(1.2, 20);
}

Path sliding_mode()
{
    return [] {
        auto result = hand_over(SlidingMode{}, SlidingMode::Vector::Constant(SlidingMode::start),
                                {.t_end = SlidingMode::t_end, .rtol = 1e-8, .atol = 1e-8});
        keep(result.t);
    };
}

Path circuit_by_steps()
{
    return [] {
        SetValuedMotion<DiodeCircuit> motion(DiodeCircuit{}, DiodeCircuit::start(),
                                             {.t_end = 20, .step = 0.02});
        (void)motion.run();
        double w = motion.state().w[0];
        keep(w);
    };
}

Path recorded_passages(std::size_t n)
{
    const test::Oscillators system(n);
    Options options = loose;
    options.event_states = false;
    return run(Task<test::Oscillators>{.system = system, .x0 = system.start(), .t_end = 20},
               options);
}

/// As the oscillator of the report, whose wall is out of reach.
Task<report::Impacts> beside_a_far_wall()
{
    Task<report::Impacts> task = twenty_periods();
    task.system.wall = 30;
    return task;
}

/// The oscillator of the report without its wall.
struct Forced {
    using State = report::Two;
    template <class T, class X>
    constexpr void flow(const T& t, const X& x, X& dxdt) const
    {
        report::Impacts{}.flow(t, x, dxdt);
    }
};

struct Pendulum {
    using State = report::Two;
    template <class T, class X>
    constexpr void flow(const T& /*t*/, const X& x, X& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -sin(x[0]);
    }
};

/// Twelve pendulums by Taylor's method, in lanes or one after the other.
Path pendulums(bool in_lanes)
{
    std::vector<report::Two> starts;
    for (int i = 0; i < 12; ++i) starts.push_back({1.9 + 0.01 * i, 0});
    Options options = tight;
    options.t_end = 40;
    return [=] {
        double end = 0;
        if (in_lanes) {
            for (const auto& row : integrate_lanes(Pendulum{}, starts, options).rows) {
                end += row->x[0];
            }
        } else {
            for (const report::Two& start : starts) {
                end += integrate(Pendulum{}, start, options, ErrorControlled<Taylor>{}).x[0];
            }
        }
        keep(end);
    };
}

}  // namespace

std::vector<Named> paths_of_runs()
{
    using report::ball;
    return {
        {"diode circuit, Bathe's steps", circuit_by_steps},
        {"sliding mode, hand-over", sliding_mode},
        // What others take beside them.
        {"20 components, dopri5", [] { return run(report::rotations(20), loose); }},
        {"200 components, dopri5", [] { return run(report::rotations(200), loose); }},
        {"2000 components, dopri5", [] { return run(report::rotations(2000), loose); }},
        {"ball, dopri5 by name", [] { return run(ball(), tight, ByName{{MethodName::dopri5}}); }},
        {"impacts, fehlberg78 by name",
         [] { return run(twenty_periods(), tight, ByName{{MethodName::fehlberg78}}); }},
        {"200 components, dopri5 by name",
         [] { return run(report::rotations(200), loose, ByName{{MethodName::dopri5}}); }},
        {"10 oscillators, recorded passages", [] { return recorded_passages(10); }},
        {"1000 oscillators, recorded passages", [] { return recorded_passages(1000); }},
        {"forced oscillator, Taylor",
         [] {
             return run(Task<Forced>{.x0 = {0, 0}, .t_end = twenty_periods().t_end}, tight,
                        ErrorControlled<Taylor>{});
         }},
        {"far wall, Taylor",
         [] { return run(beside_a_far_wall(), tight, ErrorControlled<Taylor>{}); }},
        {"12 pendulums, Taylor", [] { return pendulums(false); }},
        {"12 pendulums, Taylor in lanes", [] { return pendulums(true); }},
    };
}

}  // namespace ricochet::bench
