// Two pitfalls are avoided. The first-same-as-last steppers keep the last derivative, which an
// impact makes invalid: the stepper is restarted. And the stepper that advances is never used to
// probe inside its own step. On a parabola the only error is rounding and the step would grow
// without bound, so it is limited to the remaining time. After an impact the guard is zero, which a
// root finder would take for its root: TOMS 748 starts a thousandth of the step later.
#include "odeint_by_hand.hpp"

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/dense_output_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <cstdint>

namespace ricochet::bench {

namespace {

namespace odeint = boost::numeric::odeint;
using State = std::array<double, 2>;

/// The midpoint of [lo, hi] at which `below` turns true, to adjacent doubles.
template <class Predicate>
[[nodiscard]] double bisect(double lo, double hi, Predicate below)
{
    for (;;) {
        const double middle = lo + (hi - lo) / 2;
        if (middle <= lo || middle >= hi) return hi;
        (below(middle) ? hi : lo) = middle;
    }
}

/// Where on the step from 0 to `length` the guard is no longer positive, by bisection.
struct Bisected {
    template <class Guard>
    [[nodiscard]] double operator()(double length, const Guard& guard) const
    {
        return bisect(0, length, [&](double s) { return guard(s) <= 0; });
    }
};

struct Toms748Solved {
    template <class Guard>
    [[nodiscard]] double operator()(double length, const Guard& guard) const
    {
        double lo = 0;
        double g_lo = guard(lo);
        if (g_lo <= 0) g_lo = guard(lo = 1e-3 * length);
        const double g_hi = guard(length);
        if (g_lo <= 0 || g_hi >= 0) return g_lo <= 0 ? lo : length;
        std::uintmax_t most = 100;
        return boost::math::tools::toms748_solve(guard, lo, length, g_lo, g_hi,
                                                 boost::math::tools::eps_tolerance<double>(52),
                                                 most)
            .second;
    }
};

template <class System>
[[nodiscard]] ByHand on_dense_output(const System& system, const State& x0, double t_end,
                                     double tolerance, std::size_t events)
{
    ByHand run;
    run.times.reserve(events);
    const auto flow = [&](const State& x, State& dxdt, double t) {
        ++run.flow_calls;
        system.flow(t, x, dxdt);
    };
    const auto guard = [&](double t, const State& x) {
        ++run.guard_calls;
        return system.guard(t, x);
    };
    auto stepper =
        odeint::make_dense_output(tolerance, tolerance, odeint::runge_kutta_dopri5<State>());
    stepper.initialize(x0, 0, 1e-2);
    while (stepper.current_time() < t_end) {
        const auto [t0, t1] = stepper.do_step(flow);
        ++run.steps;
        if (guard(t1, stepper.current_state()) > 0) continue;
        State x{};
        const double t = bisect(t0, t1, [&](double middle) {
            stepper.calc_state(middle, x);
            return guard(middle, x) <= 0;
        });
        if (t > t_end) break;
        run.times.push_back(t);
        stepper.calc_state(t, x);
        system.reset(t, x);
        stepper.initialize(x, t, std::min(stepper.current_time_step(), t_end - t));
    }
    return run;
}

template <class System, class RootFinder>
[[nodiscard]] ByHand on_step_map(const System& system, const State& x0, double t_end,
                                 double tolerance, std::size_t events, const RootFinder& root)
{
    ByHand run;
    run.times.reserve(events);
    const auto flow = [&](const State& x, State& dxdt, double t) {
        ++run.flow_calls;
        system.flow(t, x, dxdt);
    };
    const auto guard = [&](double t, const State& x) {
        ++run.guard_calls;
        return system.guard(t, x);
    };
    auto stepper =
        odeint::make_controlled(tolerance, tolerance, odeint::runge_kutta_dopri5<State>());
    odeint::runge_kutta_dopri5<State> probe;
    State x = x0;
    double t = 0;
    double h = 1e-2;
    while (t < t_end) {
        const State start = x;
        const double t0 = t;
        h = std::min(h, t_end - t);
        if (stepper.try_step(flow, x, t, h) == odeint::fail) continue;
        ++run.steps;
        if (guard(t, x) > 0) continue;
        State rate{};
        State rate_after{};
        flow(start, rate, t0);
        const double s = root(t - t0, [&](double offset) {
            probe.do_step(flow, start, rate, t0, x, rate_after, offset);
            return guard(t0 + offset, x);
        });
        if (t0 + s > t_end) break;
        probe.do_step(flow, start, rate, t0, x, rate_after, s);
        t = t0 + s;
        run.times.push_back(t);
        system.reset(t, x);
        stepper.reset();
    }
    return run;
}

}  // namespace

ByHand by_hand_on_dense_output(const BouncingBall& ball, const State& x0, double t_end,
                               double tolerance)
{
    return on_dense_output(ball, x0, t_end, tolerance, 16);
}

ByHand by_hand_on_step_map(const BouncingBall& ball, const State& x0, double t_end,
                           double tolerance)
{
    return on_step_map(ball, x0, t_end, tolerance, 16, Bisected{});
}

ByHand by_hand_on_dense_output(const ImpactOscillator& oscillator, const State& x0, double t_end,
                               double tolerance)
{
    return on_dense_output(oscillator, x0, t_end, tolerance, 256);
}

ByHand by_hand_on_step_map(const ImpactOscillator& oscillator, const State& x0, double t_end,
                           double tolerance)
{
    return on_step_map(oscillator, x0, t_end, tolerance, 256, Bisected{});
}

ByHand by_hand_with_toms748(const ImpactOscillator& oscillator, const State& x0, double t_end,
                            double tolerance)
{
    return on_step_map(oscillator, x0, t_end, tolerance, 256, Toms748Solved{});
}

}  // namespace ricochet::bench
