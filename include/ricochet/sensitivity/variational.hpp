// A hybrid system together with its derivatives, as a hybrid system.
//
//     flow    x' = f,  S' = f_x S + f_p
//     guards  those of x alone
//     resets  x⁺ = R,  S⁺ by the saltation matrix (see saltation.hpp)
//
// so that the variational equations run like any other system: with the same detectors,
// locators and methods, and with the derivatives under the same error control.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/guard_count.hpp"
#include "ricochet/detail/refusals.hpp"
#include "ricochet/detail/scratch.hpp"
#include "ricochet/options.hpp"
#include "ricochet/sensitivity/detail/linearization.hpp"
#include "ricochet/sensitivity/detail/saltation.hpp"
#include "ricochet/sensitivity/directions.hpp"
#include "ricochet/sensitivity/undefined.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

/// The variational system of `System` on states X, in `columns()` directions.
///
/// Its state is the matrix with n + 1 rows
///
///     x    S         n components of the state, and their derivatives
///     T    dT        time of the last event [s], and its derivatives
///
/// column by column, followed by two numbers: the `Undefined` reason why the derivatives no
/// longer exist, and the time [s] of the last event of a guard. Once a derivative
/// is undefined S stays zero; the motion x continues.
///
/// The derivatives of the system's functions are those that it declares (see linearization.hpp),
/// else dual numbers or differences. Modes and recorded events are those of the system.
template <class System, class X = typename System::State>
class Variational
    : public detail::GuardCount<Guarded<System, X> ? fixed_guard_count<System, X>() : 0> {
    static constexpr std::size_t fixed_guards =
        Guarded<System, X> ? fixed_guard_count<System, X>() : 0;
    static constexpr std::size_t fixed = detail::fixed_size<X>();
    static constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    static constexpr double never = -std::numeric_limits<double>::max();

public:
    using State = std::vector<double>;
    static constexpr bool unchecked_names = true;  // some members are absent where the system lacks
                                                   // them
    static constexpr bool changes_dimension = requires { requires System::changes_dimension; };

    /// @param options  tolerances of the run, by which grazing is distinguished from crossing
    /// @throws std::invalid_argument for invalid directions; passes on all exceptions of
    /// `Parameter::with`.
    Variational(const System& system, const X& x0, const Directions<System>& directions,
                const Options& options)
        : detail::GuardCount<fixed_guards>(guard_count_of<X>(system)),
          saltation_(detail::Linearization<System, X>(system, directions.parameters,
                                                      directions.differences, pos(x0.size())),
                     directions.initial_state ? pos(x0.size()) : 0, options),
          like_(x0),
          start_(start_of(x0, directions, options.t_start))
    {
    }

    [[nodiscard]] std::size_t columns() const noexcept { return saltation_.columns(); }

    /// State in which its runs start.
    [[nodiscard]] const State& start() const noexcept { return start_; }

    /// Absolute tolerances of the components and of their derivatives; empty if one holds for all.
    [[nodiscard]] std::vector<double> tolerances(const Options& options) const
    {
        const std::vector<double>& each = options.component_atol;
        if (each.empty()) return {};
        const std::size_t n = components(start_);
        if (each.size() != n) detail::throw_wrong_tolerances(n, each.size());
        std::vector<double> out(start_.size(), options.atol);
        for (std::size_t column = 0; column <= columns(); ++column) {
            std::ranges::copy(each, out.begin() + static_cast<std::ptrdiff_t>(column * (n + 1)));
        }
        return out;
    }

    // --- parts of its state ---

    [[nodiscard]] std::size_t components(const State& y) const noexcept
    {
        return (y.size() - 2) / (columns() + 1) - 1;
    }
    /// x.
    [[nodiscard]] X state(const State& y) const { return head(y); }
    /// S, n x columns.
    [[nodiscard]] Eigen::MatrixXd derivatives(const State& y) const
    {
        return matrix(y).topRightCorner(index(components(y)), index(columns()));
    }
    /// Time of the last event that changed the motion [s], and its derivatives; before
    /// the first event it is a number below all times.
    [[nodiscard]] double last_event(const State& y) const { return y[components(y)]; }
    [[nodiscard]] Eigen::VectorXd last_event_derivatives(const State& y) const
    {
        return matrix(y).bottomRightCorner(1, index(columns())).transpose();
    }
    [[nodiscard]] static Undefined undefined(const State& y) noexcept
    {
        return static_cast<Undefined>(static_cast<int>(y[y.size() - 2]));
    }

    /// Derivatives of the time at which a guard crosses, at t [s] in state y.
    [[nodiscard]] detail::EventTime crossing(std::size_t which, Mode mode, double t,
                                             const State& y) const
    {
        return saltation_.crossing(which, motion_at(mode, t, y), last_event_of(y));
    }

    /// Whether the events at t [s], which led from one mode and state to the other, have put a
    /// guard on its surface, and some neighbouring motions beside it, where it makes a difference.
    [[nodiscard]] bool leaves_surface(double t, Mode mode_before, const State& before,
                                      Mode mode_after, const State& after) const
    {
        return saltation_.leaves_surface(motion_at(mode_before, t, before),
                                         motion_at(mode_after, t, after), last_event_of(after));
    }

    /// Derivatives of the time of a time event at t [s].
    [[nodiscard]] detail::EventTime time_event(double t) const { return saltation_.time_event(t); }

    /// x' at t [s].
    [[nodiscard]] X rate(Mode mode, double t, const State& y) const
    {
        return linearization().flow(mode, t, head(y));
    }

    // --- the system ---

    void flow(Mode mode, double t, const State& y, State& dydt) const requires Moded<System, X>
    {
        variational_flow(mode, t, y, dydt);
    }
    void flow(double t, const State& y, State& dydt) const requires(!Moded<System, X>)
    {
        variational_flow(0, t, y, dydt);
    }
    /// The same for power series, where the flow of the system takes any scalar.
    template <class S>
    requires std::is_same_v<S, detail::Recorded> && detail::flow_takes_duals<System, X>
    void flow(Mode mode, const S& t, const std::vector<S>& y,
              std::vector<S>& dydt) const requires Moded<System, X>
    {
        variational_series(mode, t, y, dydt);
    }
    template <class S>
    requires std::is_same_v<S, detail::Recorded> && detail::flow_takes_duals<System, X>
    void flow(const S& t, const std::vector<S>& y, std::vector<S>& dydt) const
        requires(!Moded<System, X>)
    {
        variational_series(0, t, y, dydt);
    }

    template <class V>
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t,
                               const V& y) const requires detail::GuardAlone<System, X>
    {
        return with_head(
            y, [&](const X& x) { return detail::call_guard(system(), which, mode, t, x); });
    }

    void guards(Mode mode, double t, const State& y,
                std::span<double> g) const requires detail::GuardsTogether<System, X>
    {
        with_head(y, [&](const X& x) { detail::call_guards(system(), mode, t, x, g); });
    }

    template <class V, class D>
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const V& y,
                                    const D& dydt) const requires detail::RateAlone<System, X>
    {
        return with_head(y, [&](const X& x) {
            return with_head(dydt, [&](const X& dxdt) {
                return detail::call_rate(system(), which, detail::Along{mode, t, x, dxdt});
            });
        });
    }

    void guard_rates(Mode mode, double t, const State& y, const State& dydt,
                     std::span<double> rates) const requires detail::RatesTogether<System, X>
    {
        with_head(y, [&](const X& x) {
            with_head(dydt, [&](const X& dxdt) {
                detail::call_rates(system(), detail::Along{mode, t, x, dxdt}, rates);
            });
        });
    }

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return guard_info_of<X>(system(), which);
    }

    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return detail::call_enabled_in(system(), which, mode);
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode, double t, const State& y) const
    {
        return detail::call_enabled_at(system(), which, mode, t, head(y));
    }

    [[nodiscard]] Mode reset(const FiredGuards& fired, Mode mode, double t,
                             State& y) const requires Resetting<System, X>
    {
        const X before = head(y);
        X after = before;
        detail::Conflict conflict;
        Mode next = detail::ResetSet{fired}.apply(system(), mode, t, after, conflict);
        if constexpr (detail::DecidesAfterSets<System, X>) {
            next = system().after_set(fired, mode, t, before, after);
        }
        if (!detail::fits_dimension<System>(before, after, next == mode)) {
            y.clear();  // the loop rejects it
            return mode;
        }
        if (conflict.any()) {
            detail::for_each_component(after, [&](auto i) { after[i] = nan; });
        }
        // A guard that holds the motion in place, repeatedly at one time, also holds the
        // derivatives.
        const bool again = saltation_.at_one_time(last_event(y), t);
        if (again && next == mode && same(before, after) &&
            saltation_.holds(fired, motion_at(mode, t, y))) {
            return mode;
        }
        transform(motion_at(mode, t, y), y, next, after, [&](auto& motion, auto& last) {
            return saltation_.pass_set(fired, after, motion, last);
        });
        return next;
    }

    /// The two resets of a set that contradict each other, if there are any.
    [[nodiscard]] detail::Conflict conflict(const FiredGuards& fired, Mode mode, double t,
                                            const State& y) const requires Resetting<System, X>
    {
        detail::Conflict conflict;
        X x = head(y);
        (void)detail::ResetSet{fired}.apply(system(), mode, t, x, conflict);
        return conflict;
    }

    [[nodiscard]] Mode rest(std::size_t which, Mode mode, double t,
                            State& y) const requires Resting<System, X>
    {
        const X before = head(y);
        X after = before;
        const Mode next = detail::call_rest(system(), which, mode, t, after);
        if (!detail::fits_dimension<System>(before, after, next == mode)) {
            y.clear();
            return mode;
        }
        transform(motion_at(mode, t, y), y, next, after, [&](auto& motion, auto& last) {
            // The limit of the events moves as the last event does.
            const detail::EventTime time = last.any ? detail::EventTime{Undefined::no, last.dt}
                                                    : saltation_.crossing(which, motion, last);
            if (time.undefined != Undefined::no) return time.undefined;
            std::vector<bool> held;
            if (next == mode) held = saltation_.held_by_rest(which, motion, after);
            saltation_.pass(detail::RestOf{which}, time.dt, motion, held);
            last = {t, time.dt, true, t};
            return motion.derivatives.allFinite() ? Undefined::no : Undefined::non_finite;
        });
        return next;
    }

    static_assert(!TimedByState<System, X>,
                  "ricochet: found next_time_event([mode,] t, x) in a system whose derivatives are "
                  "asked for; expected time events that do not depend on the state: "
                  "next_time_event(t) or Times, or a guard");
    [[nodiscard]] const Times& time_events() const requires detail::ListsTimes<System>
    {
        return detail::times_of(system());
    }
    [[nodiscard]] double next_time_event(double t) const requires detail::TimedByFunction<System>
    {
        return system().next_time_event(t);
    }
    [[nodiscard]] double previous_time_event(double t) const requires requires(const System& system)
    {
        system.previous_time_event(0.0);
    }
    {
        return system().previous_time_event(t);
    }
    [[nodiscard]] Mode time_reset(Mode mode, double t, State& y) const requires Timed<System>
    {
        const X before = head(y);
        X after = before;
        const Mode next = detail::apply_set(detail::TimeReset{}, system(), mode, t, after);
        if (!detail::fits_dimension<System>(before, after, next == mode)) {
            y.clear();
            return mode;
        }
        transform(motion_at(mode, t, y), y, next, after, [&](auto& motion, auto& last) {
            return saltation_.pass_set(FiredGuards({}, true), after, motion, last);
        });
        return next;
    }

    [[nodiscard]] std::size_t mode_count() const requires(
        requires(const System& s) { s.mode_count; } ||
        requires(const System& s) { s.mode_count(); })
    {
        return mode_count_of(system());
    }
    [[nodiscard]] std::string_view mode_name(Mode mode) const requires
        requires(const System& system)
    {
        system.mode_name(Mode{});
    }
    {
        return system().mode_name(mode);
    }

private:
    using Motion = detail::Motion<X>;

    template <class Integer>
    [[nodiscard]] static std::size_t pos(Integer i) noexcept
    {
        return static_cast<std::size_t>(i);
    }
    [[nodiscard]] static Eigen::Index index(std::size_t i) noexcept
    {
        return static_cast<Eigen::Index>(i);
    }

    [[nodiscard]] const detail::Linearization<System, X>& linearization() const noexcept
    {
        return saltation_.linearization();
    }
    [[nodiscard]] const System& system() const noexcept { return linearization().system(); }

    [[nodiscard]] State start_of(const X& x0, const Directions<System>& directions, double t) const
    {
        const std::size_t n = pos(x0.size());
        State y((n + 1) * (columns() + 1) + 2, 0.0);
        put(y, 0, x0);
        y[n] = never;
        y[y.size() - 1] = t;
        for (std::size_t j = 0; j < columns(); ++j) {
            const std::size_t column = (j + 1) * (n + 1);
            const auto parameter = saltation_.parameter_of(j);
            if (!parameter) {
                y[column + j] = 1;
                continue;
            }
            const std::vector<double>& start = directions.parameters[*parameter].start;
            for (std::size_t i = 0; i < start.size(); ++i) {
                y[column + i] = start[i];
            }
        }
        return y;
    }

    template <class V>
    [[nodiscard]] std::size_t components_of(const V& y) const noexcept
    {
        return fixed > 0 ? fixed : (pos(y.size()) - 2) / (columns() + 1) - 1;
    }

    /// The state at the beginning of y, or of a view of it.
    template <class V>
    [[nodiscard]] X head(const V& y) const
    {
        X x = detail::state_of_size<X>(components_of(y));
        detail::for_each_component(x, [&](auto i) { x[i] = y[pos(i)]; });
        return x;
    }

    /// `function(x)` with that state, without allocating while the dimension is that of
    /// the start.
    template <class V, class Function>
    decltype(auto) with_head(const V& y, const Function& function) const
    {
        if (components_of(y) != pos(like_.size())) return function(head(y));
        detail::Scratch<X, 1> room(like_);
        detail::for_each_component(room[0], [&](auto i) { room[0][i] = y[pos(i)]; });
        return function(std::as_const(room[0]));
    }

    static void put(State& y, std::size_t at, const X& x)
    {
        detail::for_each_component(x, [&](auto i) { y[at + pos(i)] = x[i]; });
    }

    [[nodiscard]] static bool same(const X& a, const X& b)
    {
        bool equal = a.size() == b.size();
        if (equal) detail::for_each_component(a, [&](auto i) { equal = equal && a[i] == b[i]; });
        return equal;
    }

    /// The matrix that y consists of, without the two numbers after it.
    [[nodiscard]] Eigen::Map<const Eigen::MatrixXd> matrix(const State& y) const
    {
        return {y.data(), index(components(y) + 1), index(columns() + 1)};
    }

    void variational_flow(Mode mode, double t, const State& y, State& dydt) const
    {
        const std::size_t n = components(y);
        const bool defined = undefined(y) == Undefined::no;
        with_head(y, [&](const X& x) {
            detail::Scratch<X, 3> room(x);
            X& s = room[0];
            X& ds = room[1];
            X& by = room[2];
            detail::call_flow(system(), mode, t, x, ds);
            put(dydt, 0, ds);
            for (std::size_t j = 0; j < columns(); ++j) {
                const std::size_t column = (j + 1) * (n + 1);
                detail::for_each_component(
                    s, [&](auto i) { s[i] = defined ? y[column + pos(i)] : 0; });
                linearization().flow_along(mode, t, x, s, ds);
                const auto parameter = saltation_.parameter_of(j);
                if (parameter && defined) {
                    linearization().flow_by(*parameter, mode, t, x, by);
                    detail::move(ds, ds, 1, by);
                }
                put(dydt, column, ds);
            }
        });
        for (std::size_t j = 0; j <= columns(); ++j) {
            dydt[j * (n + 1) + n] = 0;
        }
        dydt[y.size() - 2] = 0;
        dydt[y.size() - 1] = 0;
    }

    /// Values computed here after a derivative has become undefined are not used.
    template <class S>
    void variational_series(Mode mode, const S& t, const std::vector<S>& y,
                            std::vector<S>& dydt) const
    {
        const std::size_t n = components_of(y);
        detail::WithScalar<X, S> x{};
        if constexpr (fixed == 0) x.resize(n);
        for (std::size_t i = 0; i < n; ++i) x[i] = y[i];
        auto s = x, ds = x, by = x;
        const auto put_rates = [&](std::size_t column) {
            for (std::size_t i = 0; i < n; ++i) dydt[column + i] = ds[i];
            dydt[column + n] = S(0.0);
        };
        linearization().flow_of(mode, t, x, ds);
        put_rates(0);
        for (std::size_t j = 0; j < columns(); ++j) {
            const std::size_t column = (j + 1) * (n + 1);
            for (std::size_t i = 0; i < n; ++i) s[i] = y[column + i];
            linearization().flow_along_of(mode, t, x, s, ds);
            if (const auto parameter = saltation_.parameter_of(j)) {
                linearization().flow_by_of(*parameter, mode, t, x, by);
                for (std::size_t i = 0; i < n; ++i) ds[i] += by[i];
            }
            put_rates(column);
        }
        dydt[y.size() - 2] = S(0.0);
        dydt[y.size() - 1] = S(0.0);
    }

    [[nodiscard]] Motion motion_at(Mode mode, double t, const State& y) const
    {
        return {mode, t, head(y), derivatives(y)};
    }

    [[nodiscard]] detail::LastEvent last_event_of(const State& y) const
    {
        const double t = last_event(y);
        return {t, last_event_derivatives(y), t != never, y[y.size() - 1]};
    }

    /// Replaces y, whose motion this is, by the state `after` and the derivatives that `pass`
    /// computes from the motion, or by zeros if it finds that they do not exist.
    template <class Pass>
    void transform(Motion motion, State& y, Mode next, const X& after, const Pass& pass) const
    {
        detail::LastEvent last = last_event_of(y);
        Undefined reason = undefined(y);
        if (reason == Undefined::no && columns() > 0) {
            reason = pass(motion, last);
            if (reason == Undefined::no && motion.mode != next) reason = Undefined::simultaneous;
        }
        const std::size_t n = pos(after.size());
        y.assign((n + 1) * (columns() + 1) + 2, 0.0);
        put(y, 0, after);
        y[n] = last.any ? last.t : never;
        y[y.size() - 2] = static_cast<double>(reason);
        y[y.size() - 1] = last.flight_start;
        if (reason != Undefined::no) return;
        for (std::size_t j = 0; j < columns(); ++j) {
            const std::size_t column = (j + 1) * (n + 1);
            put(y, column, saltation_.column_of(motion.derivatives, j, after));
            y[column + n] = last.dt[index(j)];
        }
    }

    detail::Saltation<System, X> saltation_;
    X like_;  // of the dimension of the start
    State start_;
};

}  // namespace ricochet
