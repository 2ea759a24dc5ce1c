// Taylor's method in lanes: throughput and bits beside runs one after the other.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "measure.hpp"
#include "ricochet/lanes.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

struct LanesHenonHeiles {
    using State = std::array<double, 4>;
    static constexpr State start{0, 0.1, 0.3, 0.05};
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -x[0] - 2.0 * x[0] * x[1];
        dxdt[3] = x[1] * x[1] - x[1] - x[0] * x[0];
    }
};

struct LanesSection : LanesHenonHeiles {
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 4>& x) const
    {
        return x[0];
    }
};

struct LanesPendulum {
    using State = std::array<double, 2>;
    static constexpr State start{2, 0};
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -sin(x[0]);
    }
};

struct LanesImpact {
    using State = std::array<double, 2>;
    static constexpr State start{0, 0};
    static constexpr bool unilateral = true;
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cos;
        dxdt[0] = x[1];
        dxdt[1] = cos(0.8 * t) - x[0] - 0.1 * x[1];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return 1.0 - x[0];
    }
    void reset(double /*t*/, State& x) const
    {
        x[0] = 1;
        x[1] *= -0.8;
    }
};

/// Times 63 runs from starts of their own; returns how many times as many lanes do in a second.
template <class System>
double compare_lanes(const char* name, Measured& out)
{
    using X = typename System::State;
    const System system;
    const Options options{.t_end = 300, .rtol = 1e-12, .atol = 1e-12};
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> draw(-0.1, 0.1);
    std::vector<X> starts(63, System::start);
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
    const double pendulum = compare_lanes<LanesPendulum>("pendulum", out);
    const double galaxy = compare_lanes<LanesHenonHeiles>("Henon-Heiles", out);
    compare_lanes<LanesSection>("Henon-Heiles with a section", out);
    compare_lanes<LanesImpact>("impact oscillator", out);
    out.pass = out.pass && pendulum >= 2.5 && galaxy >= 2.5;
    out.text = fmt::format("{:.1f} and {:.1f} times", pendulum, galaxy);
    return out;
}

}  // namespace ricochet::bench
