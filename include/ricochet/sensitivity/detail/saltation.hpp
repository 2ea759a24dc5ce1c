// Internal: the declarations of this header may change without notice.
//
// Passing of derivatives through events.
//
// With S the derivatives of the state at a fixed time, g the guard, R the reset, f⁻ and
// f⁺ the flow before and after, an event moves by
//
//     dt = -(g_x S⁻ + g_p) / (g_t + g_x f⁻)
//
// and the derivatives become, through the saltation matrix,
//
//     S⁺ = R_x (S⁻ + f⁻ dt) + R_t dt + R_p - f⁺ dt
//
// (M. A. Aizerman and F. R. Gantmakher, On the stability of periodic motions, Journal of
// Applied Mathematics and Mechanics 22, 1958; R. I. Leine and H. Nijmeijer, Dynamics and
// Bifurcations of Non-Smooth Mechanical Systems, Springer, 2004; N. J. Kong, J. J. Payne,
// J. Zhu and A. M. Johnson, Saltation matrices, arXiv:2306.06862, 2023.)
//
// Where several guards fire at one time, neighbouring motions meet them one after
// another, in an order that depends on the neighbour. The derivative exists if every
// order leads to the same state and the same derivatives (S. A. Burden, S. S. Sastry,
// D. E. Koditschek and S. Revzen, Event-selected vector field discontinuities yield
// piecewise-differentiable flows, SIAM Journal on Applied Dynamical Systems 15, 2016);
// all orders are therefore tried.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/options.hpp"
#include "ricochet/sensitivity/detail/event_motion.hpp"
#include "ricochet/sensitivity/detail/linearization.hpp"
#include "ricochet/sensitivity/directions.hpp"
#include "ricochet/sensitivity/undefined.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

template <class System, class X>
class Saltation {
public:
    /// The first `initial` columns belong to the initial state, the others to the
    /// parameters.
    Saltation(Linearization<System, X> linearization, std::size_t initial, const Options& options)
        : linearization_(std::move(linearization)),
          initial_(initial),
          rtol_(std::max(options.rtol, 64 * std::numeric_limits<double>::epsilon())),
          atol_(options.atol),
          component_atol_(options.component_atol),
          event_tolerance_(std::max(options.event_tolerance, options.event_window)),
          event_rtol_(options.event_rtol),
          backward_(options.t_end < options.t_start)
    {
    }

    [[nodiscard]] const Linearization<System, X>& linearization() const noexcept
    {
        return linearization_;
    }
    [[nodiscard]] std::size_t columns() const noexcept
    {
        return initial_ + linearization_.parameters();
    }

    /// Index of the parameter of a column, or nothing for a column of the initial state.
    [[nodiscard]] std::optional<std::size_t> parameter_of(std::size_t column) const noexcept
    {
        if (column < initial_) return std::nullopt;
        return column - initial_;
    }

    /// Whether events at these times [s] are indistinguishable.
    [[nodiscard]] bool at_one_time(double earlier, double t) const noexcept
    {
        return std::fabs(t - earlier) <= window(t);
    }

    /// Derivatives of the time at which a guard crosses, at `motion`.
    [[nodiscard]] EventTime crossing(std::size_t which, const Motion<X>& motion,
                                     const LastEvent& last) const
    {
        if constexpr (Guarded<System, X>) {
            return crossing_of_guard(which, motion, last);
        } else {
            return {Undefined::off_surface, {}};
        }
    }

    /// Derivatives of the time of a time event: zero, except by parameters on which it depends.
    [[nodiscard]] EventTime time_event(double t) const
    {
        EventTime time{Undefined::no, Eigen::VectorXd::Zero(index(columns()))};
        if constexpr (Timed<System>) {
            const double reach = reach_of_time_event(t);
            for (std::size_t j = 0; j < linearization_.parameters(); ++j) {
                bool lost = moves_beyond(linearization_.around(j), t, reach);
                time.dt[index(initial_ + j)] =
                    linearization_.by_parameter(j, [&](const System& system) {
                        const double near = call_next_time_event(system, t - reach);
                        lost = lost || !(std::fabs(near - t) < reach);
                        return near;
                    });
                if (lost) return {Undefined::time_event_jumps, {}};
            }
        }
        return time;
    }

    /// The components that the rest of guard `which` holds: those whose result depends neither on
    /// the state nor on the time, if the flow at the state `after` it presses on the guard.
    [[nodiscard]] std::vector<bool> held_by_rest(std::size_t which, const Motion<X>& motion,
                                                 const X& after) const
    {
        std::vector<bool> held(static_cast<std::size_t>(after.size()), false);
        const GuardInfo info = guard_info_of<X>(system(), which);
        const double inward = info.crossing == Crossing::rising ? -1 : 1;
        // A rate that is zero has the sign that it has a little later.
        const double ahead = 1e-6 * std::max(1.0, std::fabs(motion.t));
        X later = after;
        move(later, after, ahead, linearization_.flow(motion.mode, motion.t, after));
        const double rate = linearization_.guard_rate(
            which, motion.mode, motion.t, later, linearization_.flow(motion.mode, motion.t, later));
        if (!(inward * rate < 0)) return held;
        held.assign(held.size(), true);
        const auto strike_out = [&](double dt, const X& s) {
            const X by = linearization_.reset_along(
                RestOf{which}, {.mode = motion.mode, .t = motion.t, .dt = dt, .x = motion.x}, s);
            std::size_t c = 0;
            for_each_component(by, [&](auto i) { held[c] = held[c] && by[i] == 0, ++c; });
        };
        X unit = zeros_shaped_like(motion.x);
        strike_out(1, unit);
        for_each_component(motion.x, [&](auto i) {
            unit[i] = 1;
            strike_out(0, unit);
            unit[i] = 0;
        });
        return held;
    }

    /// Takes the motion through a reset at an event that moves by dt; components that are `held`
    /// stand still from there on.
    template <class Reset>
    void pass(const Reset& reset, const Eigen::VectorXd& dt, Motion<X>& motion,
              const std::vector<bool>& held = {}) const
    {
        const Motion<X> before = motion;
        const X f_before = linearization_.flow(before.mode, before.t, before.x);
        motion.mode = apply_set(reset, system(), before.mode, before.t, motion.x);
        X f_after = linearization_.flow(motion.mode, motion.t, motion.x);
        std::size_t c = 0;
        for_each_component(f_after, [&](auto i) {
            if (c < held.size() && held[c]) f_after[i] = 0;
            ++c;
        });
        motion.derivatives.resize(index(motion.x.size()), index(columns()));
        for (std::size_t j = 0; j < columns(); ++j) {
            const double moved = dt[index(j)];
            X s = column_of(before.derivatives, j, before.x);
            move(s, s, moved, f_before);
            X after = linearization_.reset_along(
                reset, {.mode = before.mode, .t = before.t, .dt = moved, .x = before.x}, s);
            if (const auto p = parameter_of(j)) {
                const X by = linearization_.reset_by(*p, reset, before.mode, before.t, before.x);
                move(after, after, 1, by);
            }
            move(after, after, -moved, f_after);
            set_column(motion.derivatives, j, after);
        }
    }

    /// Takes the motion through all transitions that fired together, to the state `after` of
    /// the run; `last` becomes this event.
    [[nodiscard]] Undefined pass_set(const FiredGuards& fired, const X& after, Motion<X>& motion,
                                     LastEvent& last) const
    {
        Undefined undefined = Undefined::no;
        if (fired.size() == 0) {
            undefined = pass_time_event(motion, last);
        } else if constexpr (Resetting<System, X>) {
            undefined = pass_guards(fired, after, motion, last);
        }
        if (undefined == Undefined::no && !motion.derivatives.allFinite()) {
            undefined = Undefined::non_finite;
        }
        return undefined;
    }

    /// Whether the events of one time, which turned `before` into `after`, have put a guard with a
    /// reset on its surface, but not all neighbouring motions, where this makes a difference. It
    /// does if the guard then crosses its surface in a direction that counts, if it was on the side
    /// from which crossing counts, so that the events carry neighbouring motions across, or if it
    /// stays on the surface and was not there before.
    [[nodiscard]] bool leaves_surface(const Motion<X>& before, const Motion<X>& after,
                                      const LastEvent& last) const
    {
        if constexpr (Guarded<System, X>) {
            for (std::size_t i = 0; i < guard_count_of<X>(system()); ++i) {
                if (!has_reset_in(i, after)) continue;
                const Slope slope = slope_at(i, after);
                if (!(std::fabs(slope.guard) <= slope.blur)) continue;
                const bool stays = slope.rate == 0;
                if (!stays && grazes(i, after, slope, after.t - last.flight_start)) continue;
                const bool matters = stays ? !is_on_surface(i, before)
                                           : counts(i, slope.rate) || comes_from_before(i, before);
                if (matters && !all_on_surface(i, after, slope.rate, last.dt)) return true;
            }
        }
        return false;
    }

    /// Whether all guards of a set are on their surfaces, and do not cross them.
    [[nodiscard]] bool holds(const FiredGuards& fired, const Motion<X>& motion) const
    {
        if (fired.time_event()) return false;
        return std::all_of(fired.begin(), fired.end(), [&](std::size_t which) {
            const Slope slope = slope_at(which, motion);
            return std::fabs(slope.guard) <= slope.blur && slope.rate == 0;
        });
    }

    /// Column j as a vector like x.
    [[nodiscard]] static X column_of(const Eigen::MatrixXd& derivatives, std::size_t j, X x)
    {
        for_each_component(x, [&](auto i) { x[i] = derivatives(index(i), index(j)); });
        return x;
    }

private:
    // Orders of events are compared by numbers that are computed with differences.
    static constexpr double same_state = 1e-9;
    static constexpr double same_derivative = 1e-6;
    static constexpr std::size_t most_orders = 5;  // 120 orders

    struct Slope {
        double guard;
        double rate;
        double blur;  // uncertainty of the guard in the run
        X flow;
    };

    template <class Integer>
    [[nodiscard]] static Eigen::Index index(Integer i) noexcept
    {
        return static_cast<Eigen::Index>(i);
    }

    static void set_column(Eigen::MatrixXd& derivatives, std::size_t j, const X& s)
    {
        for_each_component(s, [&](auto i) { derivatives(index(i), index(j)) = s[i]; });
    }

    [[nodiscard]] const System& system() const noexcept { return linearization_.system(); }

    [[nodiscard]] EventTime crossing_of_guard(std::size_t which, const Motion<X>& motion,
                                              const LastEvent& last) const
    {
        if (guard_info_of<X>(system(), which).boolean) return {Undefined::boolean_guard, {}};
        const Slope slope = slope_at(which, motion);
        const bool on_surface = std::fabs(slope.guard) <= slope.blur;
        const bool follows = coincides(last, motion.t);
        if (!on_surface) {
            // A guard that an event at this time has moved beyond its surface fires together
            // with that event.
            return follows ? EventTime{Undefined::no, last.dt}
                           : EventTime{Undefined::off_surface, {}};
        }
        if (grazes(which, motion, slope, motion.t - last.flight_start)) {
            return {Undefined::grazing, {}};
        }
        EventTime time{Undefined::no, moves(which, motion, slope.rate)};
        if (!time.dt.allFinite()) return {Undefined::non_finite, {}};
        // An event at this time has put the guard on its surface: that puts its neighbours on the
        // surface too, or some of them beyond it and some not.
        if (follows && !agree(time.dt, last.dt, same_derivative)) {
            return {Undefined::simultaneous, {}};
        }
        return time;
    }

    /// The difference above which two times [s] are distinguishable.
    [[nodiscard]] double window(double t) const noexcept
    {
        return event_tolerance_ + (event_rtol_ + 16 * epsilon) * std::fabs(t);
    }

    template <class Index>
    [[nodiscard]] double atol_of(Index i) const noexcept
    {
        const auto c = static_cast<std::size_t>(i);
        return c < component_atol_.size() ? component_atol_[c] : atol_;
    }

    [[nodiscard]] bool coincides(const LastEvent& last, double t) const noexcept
    {
        return last.any && at_one_time(last.t, t);
    }

    [[nodiscard]] Slope slope_at(std::size_t which, const Motion<X>& m) const
    {
        Slope slope{.guard = linearization_.guard(which, m.mode, m.t, m.x),
                    .rate = 0,
                    .blur = 0,
                    .flow = linearization_.flow(m.mode, m.t, m.x)};
        slope.rate = linearization_.guard_rate(which, m.mode, m.t, m.x, slope.flow);
        X unit = zeros_shaped_like(m.x);
        for_each_component(m.x, [&](auto i) {
            unit[i] = 1;
            const double along = linearization_.guard_along(which, m.mode, m.t, m.x, unit);
            unit[i] = 0;
            slope.blur += std::fabs(along) * (atol_of(i) + rtol_ * std::fabs(m.x[i]));
        });
        slope.blur += std::fabs(slope.rate) * window(m.t);
        return slope;
    }

    /// Whether the guard turns back before it is beyond its surface by more than its
    /// blur: its rate changes by its own size within the time in which the guard
    /// moves by the blur. A guard that turns often, like that of a ball on its last bounces,
    /// would always do so within a long time, which is therefore limited to a hundredth of the
    /// time since the last event.
    [[nodiscard]] bool grazes(std::size_t which, const Motion<X>& m, const Slope& slope,
                              double flight) const
    {
        if (slope.rate == 0) return true;
        const double reach = std::min(slope.blur / std::fabs(slope.rate), std::fabs(flight) / 100);
        for (const double s : {-reach, reach}) {
            const X x = moved_along(m.x, s, slope.flow);
            const X f = linearization_.flow(m.mode, m.t + s, x);
            const double rate = linearization_.guard_rate(which, m.mode, m.t + s, x, f);
            if (!(std::fabs(rate - slope.rate) < std::fabs(slope.rate))) return true;
        }
        return false;
    }

    /// dt = -(g_x S + g_p) / rate.
    [[nodiscard]] Eigen::VectorXd moves(std::size_t which, const Motion<X>& m, double rate) const
    {
        Eigen::VectorXd dt(index(columns()));
        for (std::size_t j = 0; j < columns(); ++j) {
            const X s = column_of(m.derivatives, j, m.x);
            double change = linearization_.guard_along(which, m.mode, m.t, m.x, s);
            if (const auto p = parameter_of(j)) {
                change += linearization_.guard_by(*p, which, m.mode, m.t, m.x);
            }
            dt[index(j)] = change == 0 ? 0 : -change / rate;
        }
        return dt;
    }

    /// Distance in time [s] around t without another time event.
    [[nodiscard]] double reach_of_time_event(double t) const
    {
        double reach = std::min(call_next_time_event(system(), t) - t, 1 + std::fabs(t)) / 4;
        while (call_next_time_event(system(), t - reach) < t && t - reach / 2 < t) reach /= 2;
        return reach;
    }

    /// Whether the differences by a parameter move the time event at t farther than `reach`, as the
    /// closest system predicts: from there on another event may take its place.
    [[nodiscard]] static bool moves_beyond(const Neighbours<System>& around, double t, double reach)
    {
        const double moved = std::fabs(call_next_time_event(*around.closest, t - reach) - t);
        const double rounding = 8 * epsilon * std::fabs(t);
        return !(std::max(moved - rounding, 0.0) * around.widening() < reach);
    }

    [[nodiscard]] Undefined pass_time_event(Motion<X>& motion, LastEvent& last) const
    {
        const EventTime time = time_event(motion.t);
        if (time.undefined != Undefined::no) return time.undefined;
        if (meets_others({no_guard}, motion, last)) return Undefined::simultaneous;
        pass(TimeReset{}, time.dt, motion);
        last = {motion.t, time.dt, true, last.flight_start};
        return Undefined::no;
    }

    [[nodiscard]] Undefined pass_guards(const FiredGuards& fired, const X& after, Motion<X>& motion,
                                        LastEvent& last) const
    {
        const std::vector<std::size_t> acting = acting_of(fired);
        if (acting.empty()) return Undefined::no;
        if (meets_others(acting, motion, last)) return Undefined::simultaneous;
        if (acting.size() == 1 && acting[0] != no_guard) {
            const EventTime time = crossing(acting[0], motion, last);
            if (time.undefined != Undefined::no) return time.undefined;
            pass(ResetSet{fired}, time.dt, motion);
            last = {motion.t, time.dt, true, motion.t};
            return Undefined::no;
        }
        if (all_pushed(acting, motion, last)) {
            pass(ResetSet{fired}, last.dt, motion);
            // Resets that agree here may contradict each other beside it.
            return motion.derivatives.allFinite() ? Undefined::no : Undefined::simultaneous;
        }
        const Undefined undefined = pass_in_all_orders(acting, motion, last);
        if (undefined != Undefined::no) return undefined;
        return agree(motion.x, after, same_state) ? Undefined::no : Undefined::simultaneous;
    }

    /// The guards of the set that have a reset, with `no_guard` for a time event.
    [[nodiscard]] std::vector<std::size_t> acting_of(const FiredGuards& fired) const
    {
        std::vector<std::size_t> acting;
        for (const std::size_t which : fired) {
            if (guard_info_of<X>(system(), which).resets) acting.push_back(which);
        }
        if (fired.time_event()) acting.push_back(no_guard);
        return acting;
    }

    /// Whether guards that have not fired cross their surfaces here as well, within their blur, and
    /// it makes a difference that some neighbouring motions meet them first.
    [[nodiscard]] bool meets_others(std::vector<std::size_t> acting, const Motion<X>& motion,
                                    const LastEvent& last) const
    {
        if constexpr (Resetting<System, X>) {
            if (coincides(last, motion.t)) return false;
            const std::size_t fired = acting.size();
            std::vector<std::size_t> returning;
            for (std::size_t i = 0; i < guard_count_of<X>(system()); ++i) {
                if (std::find(acting.begin(), acting.end(), i) != acting.end()) continue;
                const Slope slope = slope_at(i, motion);
                if (!crosses_here(i, motion, slope, last)) continue;
                (counts(i, slope.rate) ? acting : returning).push_back(i);
            }
            if (returning.empty() && acting.size() == fired) return false;
            Motion<X> way = motion;
            LastEvent event = last;
            if (pass_in_all_orders(acting, way, event) != Undefined::no) return true;
            return std::any_of(returning.begin(), returning.end(), [&](std::size_t i) {
                return is_carried_back(i, motion, way, event.dt);
            });
        } else {
            return false;
        }
    }

    /// Whether a guard with a reset crosses its surface here.
    [[nodiscard]] bool crosses_here(std::size_t which, const Motion<X>& motion, const Slope& slope,
                                    const LastEvent& last) const
    {
        return std::fabs(slope.guard) <= slope.blur && has_reset_in(which, motion) &&
               !grazes(which, motion, slope, motion.t - last.flight_start);
    }

    /// Whether the guard has a value and a reset, and is examined here.
    [[nodiscard]] bool has_reset_in(std::size_t which, const Motion<X>& motion) const
    {
        const GuardInfo info = guard_info_of<X>(system(), which);
        return info.resets && !info.boolean && call_enabled_in(system(), which, motion.mode) &&
               call_enabled_at(system(), which, motion.mode, motion.t, motion.x);
    }

    /// Whether the guard is clearly on the side of its surface from which crossing it counts.
    [[nodiscard]] bool comes_from_before(std::size_t which, const Motion<X>& motion) const
    {
        if (!call_enabled_in(system(), which, motion.mode)) return false;
        if (is_on_surface(which, motion)) return false;
        const Crossing crossing = guard_info_of<X>(system(), which).crossing;
        const double guard = linearization_.guard(which, motion.mode, motion.t, motion.x);
        return crossing == Crossing::either || (guard > 0) == (crossing == Crossing::falling);
    }

    [[nodiscard]] bool is_on_surface(std::size_t which, const Motion<X>& motion) const
    {
        const Slope slope = slope_at(which, motion);
        return std::fabs(slope.guard) <= slope.blur;
    }

    /// Whether neighbouring motions that are put here at an event that moves by dt are put on the
    /// surface of this guard, too.
    [[nodiscard]] bool all_on_surface(std::size_t which, const Motion<X>& m, double rate,
                                      const Eigen::VectorXd& dt) const
    {
        if (rate != 0) return agree(moves(which, m, rate), dt, same_derivative);
        for (std::size_t j = 0; j < columns(); ++j) {
            const X s = column_of(m.derivatives, j, m.x);
            double change = linearization_.guard_along(which, m.mode, m.t, m.x, s);
            double size = 0;
            X part = zeros_shaped_like(s);
            for_each_component(s, [&](auto i) {
                part[i] = s[i];
                size += std::fabs(linearization_.guard_along(which, m.mode, m.t, m.x, part));
                part[i] = 0;
            });
            if (const auto p = parameter_of(j)) {
                const double by = linearization_.guard_by(*p, which, m.mode, m.t, m.x);
                change += by;
                size += std::fabs(by);
            }
            if (std::fabs(change) > same_derivative * size) return false;
        }
        return true;
    }

    /// Whether an event is a crossing in the direction of this rate.
    [[nodiscard]] bool counts(std::size_t which, double rate) const
    {
        const Crossing crossing = guard_info_of<X>(system(), which).crossing;
        const bool falls = (rate < 0) != backward_;
        return crossing == Crossing::either || falls == (crossing == Crossing::falling);
    }

    /// Whether resets from `before` to `after` carry a guard back across the surface that it has
    /// reached, while for some neighbouring motions it has not.
    [[nodiscard]] bool is_carried_back(std::size_t which, const Motion<X>& before,
                                       const Motion<X>& after, const Eigen::VectorXd& dt) const
    {
        if (!call_enabled_in(system(), which, after.mode)) return false;
        const Slope there = slope_at(which, after);
        const double rate = slope_at(which, before).rate;
        const bool back = (there.guard < 0) == ((rate > 0) != backward_);
        return back && std::fabs(there.guard) > there.blur &&
               !agree(moves(which, before, rate), dt, same_derivative);
    }

    [[nodiscard]] Undefined pass_in_all_orders(std::vector<std::size_t> order, Motion<X>& motion,
                                               LastEvent& last) const
    {
        if (order.size() > most_orders) return Undefined::simultaneous;
        std::sort(order.begin(), order.end());
        std::optional<Motion<X>> first;
        LastEvent first_last = last;
        do {
            Motion<X> way = motion;
            LastEvent event = last;
            const Undefined undefined = pass_in_order(order, way, event);
            if (undefined != Undefined::no) return undefined;
            if (!first) {
                first = way;
                first_last = event;
            } else if (!same(way, *first)) {
                return Undefined::simultaneous;
            }
        } while (std::next_permutation(order.begin(), order.end()));
        motion = *first;
        last = first_last;
        return Undefined::no;
    }

    /// Whether one event at this time has moved all of them beyond their surfaces.
    [[nodiscard]] bool all_pushed(const std::vector<std::size_t>& acting, const Motion<X>& m,
                                  const LastEvent& last) const
    {
        if (!coincides(last, m.t)) return false;
        return std::all_of(acting.begin(), acting.end(), [&](std::size_t which) {
            if (which == no_guard) return false;
            const Slope slope = slope_at(which, m);
            return std::fabs(slope.guard) > slope.blur;
        });
    }

    /// Applies the resets one after the other, each to the state that the previous ones have left.
    [[nodiscard]] Undefined pass_in_order(const std::vector<std::size_t>& order, Motion<X>& way,
                                          LastEvent& last) const
    {
        const Motion<X> start = way;
        const LastEvent before = last;
        bool together = true;
        Eigen::VectorXd dt;
        for (const std::size_t which : order) {
            const bool timed = which == no_guard;
            if (!timed && !still_fires(which, start, way)) continue;
            LastEvent none = before;
            if (dt.size() > 0) none.any = false;
            const EventTime time = timed ? time_event(way.t) : crossing(which, way, none);
            if (time.undefined == Undefined::off_surface && dt.size() > 0) {
                return Undefined::simultaneous;
            }
            if (time.undefined != Undefined::no) return time.undefined;
            together = together && (dt.size() == 0 || agree(dt, time.dt, same_derivative));
            dt = time.dt;
            if (timed) {
                pass(TimeReset{}, dt, way);
            } else {
                pass(ResetOf{which}, dt, way);
                last.flight_start = way.t;
            }
        }
        // Events that move differently do not count as a cause of the next event at this time.
        last.any = together;
        last.t = way.t;
        last.dt = dt;
        return Undefined::no;
    }

    /// Whether a guard that fired at `start` still does at `way`, after the reset of another one,
    /// which may have disabled it or turned it back.
    [[nodiscard]] bool still_fires(std::size_t which, const Motion<X>& start,
                                   const Motion<X>& way) const
    {
        if (!call_enabled_in(system(), which, way.mode)) return false;
        const auto rate = [&](const Motion<X>& m) {
            return linearization_.guard_rate(which, m.mode, m.t, m.x,
                                             linearization_.flow(m.mode, m.t, m.x));
        };
        return rate(start) * rate(way) > 0;
    }

    [[nodiscard]] static bool same(const Motion<X>& a, const Motion<X>& b)
    {
        return a.mode == b.mode && agree(a.x, b.x, same_state) &&
               agree(a.derivatives.reshaped(), b.derivatives.reshaped(), same_derivative);
    }

    static constexpr double epsilon = std::numeric_limits<double>::epsilon();

    Linearization<System, X> linearization_;
    std::size_t initial_;
    double rtol_;
    double atol_;
    std::vector<double> component_atol_;
    double event_tolerance_;
    double event_rtol_;
    bool backward_;
};

}  // namespace ricochet::detail
