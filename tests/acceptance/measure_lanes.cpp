// Taylor's method in lanes: throughput and bits beside runs one after the other.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "measure.hpp"
#include "ricochet/lanes.hpp"
#include "taylor_systems.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

/// Henon-Heiles with an event at every passage through x = 0.
struct Section : HenonHeiles {
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 4>& x) const
    {
        return x[0];
    }
};

/// Times 63 runs from different starts around `start`; returns the ratio of the numbers of runs
/// that lanes and single runs complete in a second.
template <class System>
double compare_lanes(const char* name, const typename System::State& around, Measured& out)
{
    using X = typename System::State;
    const System system;
    const Options options{.t_end = 300, .rtol = 1e-12, .atol = 1e-12};
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> draw(-0.1, 0.1);
    std::vector<X> starts(63, around);
    for (X& start : starts) {
        for (double& component : start) component += draw(random);
    }
    const auto alone = [=] {
        std::vector<Run<X>> runs;
        runs.reserve(starts.size());
        for (const X& start : starts) {
            runs.push_back(integrate(system, start, options, ErrorControlled<Taylor>{}));
        }
        return runs;
    };
    const auto lanes = [=] { return integrate_lanes(system, starts, options); };
    const auto expected = alone();
    const auto found = lanes();
    std::size_t differ = 0, steps = 0, events = 0;
    for (std::size_t row = 0; row < starts.size(); ++row) {
        const Run<X>& run = expected[row];
        bool same = found.rows[row] && found.rows[row]->x == run.x &&
                    found.rows[row]->events.size() == run.events.size();
        for (std::size_t i = 0; same && i < run.events.size(); ++i) {
            same = found.rows[row]->events[i].t == run.events[i].t;
        }
        differ += same ? 0 : 1;
        steps += run.statistics.steps;
        events += run.events.size();
    }
    const std::vector<Work> works{repeated(alone), repeated(lanes)};
    const auto times = time_in_turns(works, {.budget = 0.5});
    const double ratio = times[0].p10 / times[1].p10;
    const double each = 1e9 / static_cast<double>(steps);
    out.pass = out.pass && differ == 0;
    out.details.push_back(fmt::format(
        "{}: {:.2f} times, {:.0f} ns a step instead of {:.0f}, {:.0f} steps an event, "
        "{} of {} runs differ",
        name, ratio, times[1].p10 * each, times[0].p10 * each,
        static_cast<double>(steps) / static_cast<double>(events), differ, starts.size()));
    return ratio;
}

}  // namespace

Measured time_taylor_lanes()
{
    Measured out{.pass = true, .text = {}};
    const Four bound{0, 0.1, 0.3, 0.05};  // far below the energy of escape
    const double pendulum = compare_lanes<Pendulum>("pendulum", Pendulum::start, out);
    const double galaxy = compare_lanes<HenonHeiles>("Henon-Heiles", bound, out);
    compare_lanes<Section>("Henon-Heiles with a section", bound, out);
    compare_lanes<Impact>("impact oscillator", {0, 0}, out);
    out.pass = out.pass && pendulum >= 2.5 && galaxy >= 2.5;
    out.text = fmt::format("{:.1f} and {:.1f} times", pendulum, galaxy);
    return out;
}

}  // namespace ricochet::bench
