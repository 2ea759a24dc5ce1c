// Two traps are avoided. The first-same-as-last steppers keep the last derivative,
// which an impact makes stale: the stepper is started anew. And the stepper that
// advances is never used to probe inside its own step. On a parabola the error is
// nothing but rounding and the step grows without bound, so it is held to what is
// left of the run.
#include "odeint_by_hand.hpp"

#include <algorithm>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/dense_output_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>

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

}  // namespace

ByHand by_hand_on_dense_output(const BouncingBall& ball, const State& x0, double t_end,
                               double tolerance)
{
    ByHand run;
    run.times.reserve(16);
    const auto flow = [&](const State& x, State& dxdt, double t) {
        ++run.flow_calls;
        ball.flow(t, x, dxdt);
    };
    auto stepper =
        odeint::make_dense_output(tolerance, tolerance, odeint::runge_kutta_dopri5<State>());
    stepper.initialize(x0, 0, 1e-2);
    while (stepper.current_time() < t_end) {
        const auto [t0, t1] = stepper.do_step(flow);
        ++run.steps;
        ++run.guard_calls;
        if (stepper.current_state()[0] > 0) continue;
        State x{};
        const double t = bisect(t0, t1, [&](double middle) {
            ++run.guard_calls;
            stepper.calc_state(middle, x);
            return x[0] <= 0;
        });
        if (t > t_end) break;
        run.times.push_back(t);
        stepper.calc_state(t, x);
        ball.reset(t, x);
        stepper.initialize(x, t, std::min(stepper.current_time_step(), t_end - t));
    }
    return run;
}

ByHand by_hand_on_step_map(const BouncingBall& ball, const State& x0, double t_end,
                           double tolerance)
{
    ByHand run;
    run.times.reserve(16);
    const auto flow = [&](const State& x, State& dxdt, double t) {
        ++run.flow_calls;
        ball.flow(t, x, dxdt);
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
        ++run.guard_calls;
        if (x[0] > 0) continue;
        State rate{};
        State rate_after{};
        flow(start, rate, t0);
        const double s = bisect(0, t - t0, [&](double middle) {
            ++run.guard_calls;
            probe.do_step(flow, start, rate, t0, x, rate_after, middle);
            return x[0] <= 0;
        });
        if (t0 + s > t_end) break;
        probe.do_step(flow, start, rate, t0, x, rate_after, s);
        t = t0 + s;
        run.times.push_back(t);
        ball.reset(t, x);
        stepper.reset();
    }
    return run;
}

}  // namespace ricochet::bench
