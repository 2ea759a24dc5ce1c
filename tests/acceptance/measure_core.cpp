// Costs of the compiled core: a step without guards beside Odeint's own, the flow behind a
// pointer beside the flow inlined, and impacts in a large state beside the same by hand.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/dense_output_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "measure.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

namespace odeint = boost::numeric::odeint;

/// Harmonic oscillators side by side, all of period 2 pi.
template <class X>
struct Rotations {
    using State = X;
    void flow(double, const X& x, X& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); i += 2) {
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = -x[i];
        }
    }
};

template <class X>
X rotations_start(std::size_t n)
{
    X x{};
    if constexpr (requires { x.resize(n); }) x.resize(n);
    for (std::size_t i = 0; i < n; ++i) x[i] = 1.0 / static_cast<double>(1 + i % 7);
    return x;
}

constexpr double rtol = 1e-8;
constexpr double atol = 1e-10;

template <class X>
struct ByOdeint {
    std::size_t steps = 0;
    X x{};
};

template <class X>
ByOdeint<X> rotate_by_odeint(const X& x0, double t_end)
{
    ByOdeint<X> run{.x = x0};
    const Rotations<X> system;
    run.steps = odeint::integrate_adaptive(
        odeint::make_controlled(atol, rtol, odeint::runge_kutta_dopri5<X>()),
        [&](const X& x, X& dxdt, double t) { system.flow(t, x, dxdt); }, run.x, 0.0, t_end, 0.1);
    return run;
}

/// Time of a step relative to a step of Odeint's, in one run.
template <class X>
double step_ratio(std::size_t n, std::vector<std::string>& details)
{
    const X x0 = rotations_start<X>(n);
    const double t_end = n > 500 ? 20 : 100;
    const Rotations<X> system;
    const auto ours = [=] {
        return integrate(system, x0, {.t_end = t_end, .rtol = rtol, .atol = atol});
    };
    const auto theirs = [=] { return rotate_by_odeint(x0, t_end); };
    const auto our_steps = static_cast<double>(ours().statistics.steps);
    const auto their_steps = static_cast<double>(theirs().steps);
    const auto timings = time_in_turns(std::vector<Work>{repeated(ours), repeated(theirs)},
                                       {.budget = 3, .fewest = 21, .most = 501});
    const double ratio = timings[0].median / our_steps / (timings[1].median / their_steps);
    details.push_back(fmt::format("{} components: {:.1f} ns a step, Odeint {:.1f}, ratio {:.2f}", n,
                                  1e9 * timings[0].median / our_steps,
                                  1e9 * timings[1].median / their_steps, ratio));
    return ratio;
}

// --- impacts in a large state ---

constexpr double restitution = 0.9;
constexpr double gravity = 9.81;

struct Balls {
    using State = std::vector<double>;
    std::size_t guard_count;

    void flow(double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); i += 2) {
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = -gravity;
        }
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return x[2 * which];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double, const X&, const D& dxdt) const
    {
        return dxdt[2 * which];
    }
    void reset(std::size_t which, double, State& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] = -restitution * x[2 * which + 1];
    }
};

std::vector<double> balls_at_rest(std::size_t n)
{
    std::vector<double> x(2 * n);
    for (std::size_t i = 0; i < n; ++i) {
        x[2 * i] = 5 + 5 * std::fmod(0.618033988 * static_cast<double>(i), 1.0);
    }
    return x;
}

double balls_end(std::size_t n)
{
    return n >= 1000 ? 1.6 : 5;
}

/// The same by hand: dense output, the heights at the end of each step, the earliest impact by
/// bisection of the time at which any ball has passed the floor, and a new start. Returns the
/// number of impacts.
std::size_t drop_by_hand(std::size_t n)
{
    using State = std::vector<double>;
    const Balls system{n};
    const auto flow = [&](const State& x, State& dxdt, double t) { system.flow(t, x, dxdt); };
    const auto has_passed = [](const State& x, std::size_t i) {
        return x[2 * i] <= 0 && x[2 * i + 1] < 0;
    };
    const auto any_has_passed = [&](const State& x) {
        bool any = false;
        for (std::size_t i = 0; i < n; ++i) any = any || has_passed(x, i);
        return any;
    };
    auto stepper = odeint::make_dense_output(atol, rtol, odeint::runge_kutta_dopri5<State>());
    State x = balls_at_rest(n);
    const double t_end = balls_end(n);
    stepper.initialize(x, 0, 0.05);
    std::size_t impacts = 0;
    while (stepper.current_time() < t_end) {
        const auto [t0, t1] = stepper.do_step(flow);
        if (!any_has_passed(stepper.current_state())) continue;
        double lo = t0;
        double hi = t1;
        for (double middle = lo + (hi - lo) / 2; middle > lo && middle < hi;
             middle = lo + (hi - lo) / 2) {
            stepper.calc_state(middle, x);
            (any_has_passed(x) ? hi : lo) = middle;
        }
        if (hi >= t_end) break;
        stepper.calc_state(hi, x);
        for (std::size_t i = 0; i < n; ++i) {
            if (!has_passed(x, i)) continue;
            system.reset(i, hi, x);
            ++impacts;
        }
        stepper.initialize(x, hi, t1 - t0);
    }
    return impacts;
}

}  // namespace

Measured time_plain_steps()
{
    Measured out;
    const std::array<double, 4> ratios = {step_ratio<std::array<double, 2>>(2, out.details),
                                          step_ratio<std::vector<double>>(20, out.details),
                                          step_ratio<std::vector<double>>(200, out.details),
                                          step_ratio<std::vector<double>>(2000, out.details)};
    out.pass = *std::max_element(ratios.begin(), ratios.end()) <= 1.1;
    out.text =
        fmt::format("{:.2f}, {:.2f}, {:.2f}, {:.2f}", ratios[0], ratios[1], ratios[2], ratios[3]);
    return out;
}

Measured time_flow_by_pointer()
{
    const auto ratio = [](const auto& system, const auto& x0, const Options& options,
                          const auto& inlined, const MethodByName& by_name) {
        const auto with = [=](const auto& stepping) {
            return [=] { return integrate(system, x0, options, stepping); };
        };
        const std::vector<Work> works{repeated(with(inlined)),
                                      repeated(with(ErrorControlled<MethodByName>{by_name}))};
        const auto timings = time_in_turns(works, {.budget = 3, .fewest = 21, .most = 501});
        return timings[1].median / timings[0].median;
    };
    const double ball = ratio(BouncingBall{}, BouncingBall::State{10, 0}, {.t_end = 20.5},
                              ErrorControlled<Dopri5>{}, {MethodName::dopri5});
    const double oscillator =
        ratio(ImpactOscillator{ImpactOscillator::Parameters{}}, std::array<double, 2>{0, 0},
              {.t_end = 300, .rtol = 1e-9, .atol = 1e-9}, ErrorControlled<Fehlberg78>{},
              {MethodName::fehlberg78});
    const double large =
        ratio(Rotations<std::vector<double>>{}, rotations_start<std::vector<double>>(200),
              {.t_end = 20}, ErrorControlled<Dopri5>{}, {MethodName::dopri5});
    return {.pass = ball <= 2.2 && oscillator <= 1.1 && large <= 1.1,
            .text = fmt::format("ball {:.2f}, impact oscillator {:.2f}, 100 oscillators {:.2f}",
                                ball, oscillator, large)};
}

Measured time_large_impacts()
{
    Measured out{.pass = true, .text = {}};
    std::vector<std::string> calls;
    for (const std::size_t n : {1, 10, 100, 1000}) {
        const Balls system{n};
        const std::vector<double> x0 = balls_at_rest(n);
        const Options options{
            .t_end = balls_end(n), .rtol = rtol, .atol = atol, .record_events = false};
        const auto ours = [=] { return integrate(system, x0, options); };
        const auto theirs = [=] { return drop_by_hand(n); };
        const Statistics counts = ours().statistics;
        const auto events = static_cast<double>(counts.events);
        const auto impacts = static_cast<double>(theirs());
        const auto timings = time_in_turns(std::vector<Work>{repeated(ours), repeated(theirs)},
                                           {.budget = 3, .fewest = 11, .most = 301});
        const double flows = static_cast<double>(counts.flow_calls) / events;
        const double ratio = timings[0].median / events / (timings[1].median / impacts);
        out.pass = out.pass && flows <= 60 && ratio <= (n == 1000 ? 0.5 : 1);
        calls.push_back(fmt::format("{:.0f}", flows));
        out.details.push_back(fmt::format(
            "{} balls: {:.0f} flow and {:.0f} guard calls an impact, {:.2f} us, by hand {:.2f} us, "
            "ratio {:.2f}",
            n, flows, static_cast<double>(counts.guard_calls) / events,
            1e6 * timings[0].median / events, 1e6 * timings[1].median / impacts, ratio));
    }
    out.text = fmt::format("flow calls an impact {}", fmt::join(calls, ", "));
    return out;
}

std::vector<Check> core_checks()
{
    return {
        {.topic = "core",
         .id = "plain-steps",
         .sentence = "time of a step without guards over that of Odeint's controlled dopri5, 2, "
                     "20, 200, 2000 components",
         .target = "<= 1.1",
         .run = time_plain_steps},
        {.topic = "core",
         .id = "flow-by-pointer",
         .sentence = "time with the flow called by pointer over that with the flow inlined",
         .target = "ball <= 2.2, others <= 1.1",
         .run = time_flow_by_pointer},
        {.topic = "core",
         .id = "large-impacts",
         .sentence = "impacts of 1, 10, 100, 1000 balls in one state",
         .target = "<= 60 flow calls an impact, ahead of Odeint by hand, twice at 1000",
         .run = time_large_impacts},
        {.topic = "core",
         .id = "ensemble",
         .sentence = "100 000 balls on two threads over one; bits on 1, 2, 4",
         .target = ">= 1.8 times faster on two free cores, the same bits",
         .run = run_ensemble_of_balls},
    };
}

}  // namespace ricochet::bench
