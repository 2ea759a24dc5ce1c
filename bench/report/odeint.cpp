// Boost.Odeint in a loop written by hand, as an experienced user does: a sign check after each
// step, the crossing located on the step's own map (a second stepper repeats it, with TOMS 748 on
// its length) with states as arrays, or on the dense output with states as vectors.
//
// It is compiled in a file of its own, so that surrounding code does not change how well it is
// optimised.
#include <algorithm>
#include <boost/math/tools/roots.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/dense_output_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <boost/version.hpp>

#include "cells.hpp"
#include "seen.hpp"

namespace ricochet::report {

namespace {

namespace odeint = boost::numeric::odeint;

/// The end of the bracket on the far side of the crossing of `guard`, whose values are `g_lo` at
/// `lo` and `g_hi` at `hi`.
template <class Guard>
double cross(const Guard& guard, double lo, double hi, double g_lo, double g_hi)
{
    if (g_hi == 0) return hi;
    std::uintmax_t most = 100;
    const auto bracket = boost::math::tools::toms748_solve(
        guard, lo, hi, g_lo, g_hi, boost::math::tools::eps_tolerance<double>(52), most);
    return bracket.second;
}

/// The value of a guard after its reset, if that is zero: the side that it came from.
constexpr double on_surface = 1e-300;

struct Hit {
    double s = 0;
    std::size_t guard = 0;
};

/// Values of all guards at the start of a step and at its end.
struct Watch {
    std::vector<double> before, after;
    std::vector<Hit> hits;
};

/// Whether any guard has crossed; `watch.hits` are the crossings, in order, or only the first if
/// the system has resets. `value(which, s)` is a guard at s in [0, length].
template <class S, class Value>
bool find(Watch& watch, double length, const Value& value)
{
    watch.hits.clear();
    double end = length;
    for (std::size_t i = 0; i < watch.after.size(); ++i) {
        if (!Seen<S>::crossed(watch.before[i], watch.after[i])) continue;
        double g_end = watch.after[i];
        if (Seen<S>::acts && end < length) {
            g_end = value(i, end);
            if (!Seen<S>::crossed(watch.before[i], g_end)) continue;  // later than another
            watch.hits.clear();
        }
        // A guard that has just been reset starts on its surface: from a thousandth on.
        const double low = watch.before[i] == on_surface ? 1e-3 * end : 0;
        const double g_low = low == 0 ? watch.before[i] : value(i, low);
        const double s = Seen<S>::crossed(watch.before[i], g_low)
                             ? low
                             : cross([&](double r) { return value(i, r); }, low, end, g_low, g_end);
        watch.hits.push_back({s, i});
        if (Seen<S>::acts) end = s;
    }
    std::sort(watch.hits.begin(), watch.hits.end(),
              [](const Hit& a, const Hit& b) { return a.s < b.s; });
    return !watch.hits.empty();
}

template <class S, class X>
void look(Seen<S>& system, double t, const X& x, std::vector<double>& values)
{
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = system.guard(i, t, x);
}

template <class S>
bool on_step_map(const Task<S>& task, double tolerance, Answer& answer, std::size_t offset)
{
    using X = typename S::State;
    using Stepper = odeint::runge_kutta_dopri5<X>;
    Seen<S> system(task.system);
    const auto flow = [&](const X& x, X& dxdt, double t) { system.flow(t, x, dxdt); };
    auto stepper = odeint::make_controlled(tolerance, tolerance, Stepper());
    Stepper probe;
    Watch watch{std::vector<double>(system.guards()), std::vector<double>(system.guards()), {}};
    X x = task.x0;
    X start = x;
    X rate = x;
    X end_rate = x;
    X at = x;
    double t = 0;
    double h = task.first_step;
    look(system, t, x, watch.before);
    while (t < task.t_end) {
        start = x;
        const double t0 = t;
        h = std::min(h, task.t_end - t);
        if (stepper.try_step(flow, x, t, h) == odeint::fail) continue;
        ++*answer.steps;
        look(system, t, x, watch.after);
        bool known = false;
        const auto value = [&](std::size_t which, double s) {
            if (s == 0) return watch.before[which];
            if (!known) flow(start, rate, t0);
            known = true;
            probe.do_step(flow, start, rate, t0, at, end_rate, s);
            return system.guard(which, t0 + s, at);
        };
        if (!find<S>(watch, t - t0, value)) {
            watch.before.swap(watch.after);
            continue;
        }
        if constexpr (Seen<S>::acts) {
            const Hit hit = watch.hits.front();
            if (!known) flow(start, rate, t0);
            probe.do_step(flow, start, rate, t0, x, end_rate, hit.s);
            t = t0 + hit.s;
            answer.add(t, hit.guard + offset);
            system.reset(hit.guard, t, x);
            stepper.reset();
            look(system, t, x, watch.before);
            watch.before[hit.guard] = std::max(watch.before[hit.guard], on_surface);
        } else {
            for (const Hit& hit : watch.hits) answer.add(t0 + hit.s, hit.guard + offset);
            watch.before.swap(watch.after);
        }
    }
    note_energy(task, x, answer);
    *answer.flow_calls += system.flow_calls;
    *answer.guard_calls += system.guard_calls;
    return true;
}

template <class S>
bool on_dense_output(const Task<S>& task, double tolerance, Answer& answer, std::size_t offset)
{
    using X = std::vector<double>;
    Seen<S> system(task.system);
    const auto flow = [&](const X& x, X& dxdt, double t) { system.flow(t, x, dxdt); };
    auto stepper = odeint::make_dense_output(tolerance, tolerance, odeint::runge_kutta_dopri5<X>());
    Watch watch{std::vector<double>(system.guards()), std::vector<double>(system.guards()), {}};
    X x(task.x0.begin(), task.x0.end());
    X at = x;
    stepper.initialize(x, 0, task.first_step);
    look(system, 0, x, watch.before);
    while (stepper.current_time() < task.t_end) {
        const auto [t0, t1] = stepper.do_step(flow);
        ++*answer.steps;
        look(system, t1, stepper.current_state(), watch.after);
        const double start = t0;
        const auto value = [&](std::size_t which, double s) {
            if (s == 0) return watch.before[which];
            stepper.calc_state(start + s, at);
            return system.guard(which, start + s, at);
        };
        if (!find<S>(watch, t1 - t0, value)) {
            watch.before.swap(watch.after);
            continue;
        }
        if constexpr (Seen<S>::acts) {
            const Hit hit = watch.hits.front();
            const double t = start + hit.s;
            if (t > task.t_end) break;
            answer.add(t, hit.guard + offset);
            stepper.calc_state(t, x);
            system.reset(hit.guard, t, x);
            look(system, t, x, watch.before);
            watch.before[hit.guard] = std::max(watch.before[hit.guard], on_surface);
            stepper.initialize(x, t, std::min(stepper.current_time_step(), task.t_end - t));
        } else {
            for (const Hit& hit : watch.hits) {
                if (start + hit.s <= task.t_end) answer.add(start + hit.s, hit.guard + offset);
            }
            watch.before.swap(watch.after);
        }
    }
    note_energy(task, stepper.current_state(), answer);
    *answer.flow_calls += system.flow_calls;
    *answer.guard_calls += system.guard_calls;
    return true;
}

}  // namespace

void add_odeint(Cells& cells)
{
    cells.add_version("odeint", std::to_string(BOOST_VERSION / 100000) + "." +
                                    std::to_string(BOOST_VERSION / 100 % 1000));
    for_each_problem([&](const std::string& name, const std::string& /*title*/, const auto& make) {
        for (const double tolerance : tolerances_of(name)) {
            cells.add({name, "odeint", "step map", tolerance, [make, tolerance] {
                           return over(make(), [tolerance](const auto& task, Answer& answer,
                                                           std::size_t offset) {
                               return on_step_map(task, tolerance, answer, offset);
                           });
                       }});
            cells.add({name, "odeint", "vector, dense output", tolerance, [make, tolerance] {
                           return over(make(), [tolerance](const auto& task, Answer& answer,
                                                           std::size_t offset) {
                               return on_dense_output(task, tolerance, answer, offset);
                           });
                       }});
        }
    });
}

}  // namespace ricochet::report
