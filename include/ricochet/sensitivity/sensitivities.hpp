// A run and its derivatives with respect to initial state and parameters.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/sensitivity/detail/dual_parameter.hpp"
#include "ricochet/sensitivity/directions.hpp"
#include "ricochet/sensitivity/undefined.hpp"
#include "ricochet/sensitivity/variational.hpp"

namespace ricochet {

/// Derivatives of one event, one column for each direction. NaN if they do not exist.
struct EventSensitivity {
    Eigen::VectorXd dt;        ///< derivatives of its time [s]
    Eigen::MatrixXd before;    ///< S⁻: of the state, at the fixed time of the event
    Eigen::MatrixXd after;     ///< S⁺: of the state after it
    Eigen::MatrixXd at_event;  ///< of the state before the reset, at the moving time of the
                               ///< event: S⁻ + x' dt
};

/// The event at which the derivatives ended.
struct UndefinedAt {
    std::size_t event;  ///< index into `Run::events`
    Undefined reason;
};

/// A run with its derivatives. Columns are the directions: the components of the
/// initial state, if asked for, then the parameters.
template <class X>
struct Sensitivities {
    /// The run itself. Its `solution` stays empty.
    Run<X> run;
    /// Derivatives of each of `run.events`.
    std::vector<EventSensitivity> events;
    /// Derivatives of `run.x` at the fixed time `run.t`: n x directions. (For the event
    /// that ended a run, `events.back()` holds the derivative of the time.)
    Eigen::MatrixXd state;
    /// Derivatives at each of `run.trajectory.t`.
    std::vector<Eigen::MatrixXd> trajectory;
    /// The first event through which there is no derivative, if there is one: from there
    /// on every derivative is NaN. The run is not affected.
    std::optional<UndefinedAt> undefined_at;
};

namespace detail {

/// Splits a run of the variational system into the run and its derivatives.
template <class System, class X>
class Separation {
    using Flat = std::vector<double>;

public:
    Separation(const Variational<System, X>& variational, Run<Flat>&& flat, bool backward)
        : variational_(variational), flat_(std::move(flat)), backward_(backward)
    {
    }

    [[nodiscard]] Sensitivities<X> take(bool keep_events)
    {
        separate_run();
        name_conflict();
        separate_events();
        result_.state = derivatives_at(flat_.x, flat_.t);
        for (std::size_t k = 0; k < flat_.trajectory.t.size(); ++k) {
            result_.trajectory.push_back(
                derivatives_at(flat_.trajectory.x[k], flat_.trajectory.t[k]));
        }
        if (!keep_events) {
            result_.run.events.clear();
            result_.events.clear();
        }
        return std::move(result_);
    }

private:
    static constexpr double nan = std::numeric_limits<double>::quiet_NaN();

    void separate_run()
    {
        Run<X>& run = result_.run;
        run.outcome = flat_.outcome;
        run.t = flat_.t;
        run.x = variational_.state(flat_.x);
        run.mode = flat_.mode;
        run.guard = flat_.guard;
        run.other_guard = flat_.other_guard;
        run.statistics = flat_.statistics;
        run.trajectory.t = flat_.trajectory.t;
        for (const Flat& y : flat_.trajectory.x) {
            run.trajectory.x.push_back(variational_.state(y));
        }
        for (const Event<Flat>& event : flat_.events) {
            run.events.push_back({.t = event.t,
                                  .kind = event.kind,
                                  .guard = event.guard,
                                  .mode_before = event.mode_before,
                                  .mode_after = event.mode_after,
                                  .before = variational_.state(event.before),
                                  .after = variational_.state(event.after),
                                  .bracket = event.bracket,
                                  .slope = event.slope,
                                  .error = event.error,
                                  .late = event.late});
        }
    }

    /// Finds the resets that contradict each other, for which the variational system returns NaN.
    void name_conflict()
    {
        if constexpr (Resetting<System, X>) {
            if (flat_.outcome != Outcome::non_finite || flat_.events.empty()) return;
            const Event<Flat>& last = flat_.events.back();
            std::vector<std::size_t> guards;
            bool on_time = false;
            for (const Event<Flat>& event : flat_.events) {
                if (event.t != last.t || event.before != last.before) continue;
                if (event.kind == EventKind::time) on_time = true;
                if (changes_sign(event.kind)) guards.push_back(event.guard);
            }
            const Conflict conflict = variational_.conflict(FiredGuards(guards, on_time),
                                                            last.mode_before, last.t, last.before);
            if (!conflict.any()) return;
            result_.run.outcome = Outcome::conflicting_resets;
            result_.run.guard = conflict.first;
            result_.run.other_guard = conflict.second;
        }
    }

    void separate_events()
    {
        for (std::size_t k = 0; k < flat_.events.size(); ++k) {
            const Event<Flat>& event = flat_.events[k];
            note_undefined(k);
            EventSensitivity derivatives;
            const bool before = variational_.undefined(event.before) == Undefined::no &&
                                !(result_.undefined_at && result_.undefined_at->event < k);
            derivatives.before = matrix_of(event.before, before);
            derivatives.after = matrix_of(event.after, !result_.undefined_at);
            derivatives.dt = time_of(k, before);
            derivatives.at_event = derivatives.before;
            if (before && variational_.columns() > 0) {
                const X rate = variational_.rate(event.mode_before, event.t, event.before);
                for_each_component(rate, [&](auto i) {
                    derivatives.at_event.row(static_cast<Eigen::Index>(i)) +=
                        rate[i] * derivatives.dt.transpose();
                });
            }
            result_.events.push_back(std::move(derivatives));
        }
    }

    /// Ends the derivatives at an event that is marked as undefined, and at a touch of a guard with
    /// a reset: some neighbouring motions cross there.
    void note_undefined(std::size_t k)
    {
        if (result_.undefined_at || variational_.columns() == 0) return;
        const Event<Flat>& event = flat_.events[k];
        Undefined reason = variational_.undefined(event.after);
        if (event.kind == EventKind::touch && Resetting<System, X> &&
            variational_.guard_info(event.guard).resets) {
            reason = Undefined::grazing;
        }
        const bool is_last = k + 1 == flat_.events.size() || flat_.events[k + 1].t != event.t;
        const bool acts = event.after != event.before || event.mode_after != event.mode_before;
        if (reason == Undefined::no && is_last && acts) {
            std::size_t first = k;
            while (first > 0 && flat_.events[first - 1].t == event.t) --first;
            const Event<Flat>& start = flat_.events[first];
            if (variational_.leaves_surface(event.t, start.mode_before, start.before,
                                            event.mode_after, event.after)) {
                reason = Undefined::simultaneous;
            }
        }
        if (reason != Undefined::no) result_.undefined_at = UndefinedAt{k, reason};
    }

    [[nodiscard]] Eigen::MatrixXd matrix_of(const Flat& y, bool defined) const
    {
        Eigen::MatrixXd derivatives = variational_.derivatives(y);
        if (!defined) derivatives.setConstant(nan);
        return derivatives;
    }

    [[nodiscard]] Eigen::VectorXd undefined_time() const
    {
        return Eigen::VectorXd::Constant(static_cast<Eigen::Index>(variational_.columns()), nan);
    }

    /// Derivatives of the time of event k; `before` tells whether those of the state exist there.
    [[nodiscard]] Eigen::VectorXd time_of(std::size_t k, bool before) const
    {
        const Event<Flat>& event = flat_.events[k];
        if (!before || event.kind == EventKind::touch) return undefined_time();
        EventTime time;
        if (event.kind == EventKind::time) {
            time = variational_.time_event(event.t);
        } else if (changes_sign(event.kind)) {
            time = variational_.crossing(event.guard, event.mode_before, event.t, event.before);
        } else if (!result_.undefined_at) {
            time.dt = variational_.last_event_derivatives(event.after);
        } else {
            return undefined_time();
        }
        return time.undefined == Undefined::no ? time.dt : undefined_time();
    }

    /// Derivatives in the state y at time t; at the time of an event, those after it.
    [[nodiscard]] Eigen::MatrixXd derivatives_at(const Flat& y, double t) const
    {
        bool defined = true;
        if (result_.undefined_at) {
            const double from = flat_.events[result_.undefined_at->event].t;
            defined = backward_ ? t > from : t < from;
        }
        return matrix_of(y, defined);
    }

    const Variational<System, X>& variational_;
    Run<Flat> flat_;
    bool backward_;
    Sensitivities<X> result_;
};

}  // namespace detail

/// Integrates `system` as `integrate` does, together with the derivatives of state and
/// event times with respect to the initial state and parameters, exact through events (see
/// saltation.hpp) up to the error of the method and of differences.
///
/// @param directions  differentiation directions; {} is the initial state
/// @param options     as for the run alone; the derivatives are under its error control
///                    as well, so that the steps differ from those of the run alone, and
///                    its results by the tolerance. `record_steps` is ignored.
/// @throws std::invalid_argument as `integrate`, and for invalid directions.
///         If derivatives do not exist, `undefined_at` holds the event.
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] Sensitivities<X> sensitivities(const System& system, const X& x0,
                                             const Directions<System>& directions,
                                             const Options& options, const Stepping& stepping = {},
                                             const Detector& detector = {},
                                             const Locator& locator = {})
{
    detail::check_declarations<System, X>();
    static_assert(detail::has_flow_alone<System>());
    static_assert(
        detail::derivatives_in_order<System, X>(),
        "ricochet: found a guard_derivative or reset_derivative that takes the Mode before "
        "the number of the guard; expected ([std::size_t which,] [Mode,] double t, ...)");
    const Variational<System, X> variational(system, x0, directions, options);
    Options all = options;
    all.component_atol = variational.tolerances(options);
    all.record_events = true;
    all.event_states = true;
    all.record_steps = false;
    auto flat = integrate(variational, variational.start(), all, stepping, detector, locator);
    return detail::Separation<System, X>(variational, std::move(flat),
                                         options.t_end < options.t_start)
        .take(options.record_events);
}

/// The derivative of the state after one `period` [s] with respect to the state at its start: the
/// product of the fundamental matrices of the flights and the saltation matrices of the
/// events. NaN if it does not exist, or if the run does not reach its end. `floquet_multipliers`
/// has its eigenvalues (`eigenvalues()` of Eigen needs the header <Eigen/Eigenvalues>).
///
/// @param options  `t_end` is not used
/// @throws std::invalid_argument as `sensitivities`.
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] Eigen::MatrixXd monodromy(const System& system, const X& x0, double period,
                                        const Options& options, const Stepping& stepping = {},
                                        const Detector& detector = {}, const Locator& locator = {})
{
    Options one = options;
    one.t_end = options.t_start + period;
    auto result = sensitivities(system, x0, {}, one, stepping, detector, locator);
    if (result.run.outcome != Outcome::reached_end) {
        result.state.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    return result.state;
}

/// Eigenvalues of a monodromy matrix, the largest first; NaN where a number of it is not finite.
[[nodiscard]] Eigen::VectorXcd floquet_multipliers(const Eigen::MatrixXd& monodromy);

// Periodic orbits by shooting.
//
// A periodic orbit is a root of x(T; x0) - x0. Newton's method takes its Jacobian, M - I, from the
// monodromy matrix M through all events. If the period is unknown, too, the matrix is bordered by a
// column f(x(T)) and by the row f(guess) of a phase condition, so that corrections are taken across
// the orbit:
//
//     ( M - I      f(x(T)) ) ( dx )     ( x(T) - x0 )
//     ( f(guess)'  0       ) ( dT )  = -(     0     )
//
// (R. Seydel, Practical Bifurcation and Stability Analysis, Springer, 2010, chapter 7; with events:
// Leine and Nijmeijer 2004.) If the orbit is one of a family, as in conservative systems, that
// matrix becomes singular, and full corrections follow the family to its end, an equilibrium.
// Corrections of the Levenberg-Marquardt method with the square of the gap as parameter do not, and
// converge as fast (N. Yamashita and M. Fukushima, On the rate of convergence of the
// Levenberg-Marquardt method, Computing Supplementa 15, 2001).

/// Options of the search for an orbit.
struct Shooting {
    /// [s] Period of the orbit, positive; for an autonomous system a first guess.
    double period = std::numeric_limits<double>::quiet_NaN();
    /// Whether the system does not depend on time, so that the period is to be found.
    bool autonomous = false;
    /// The orbit has closed when |x(T) - x0| <= tolerance max(1, |x0|) in every
    /// component. What can be reached depends on `Options::rtol` and `atol`.
    double tolerance = 1e-10;
    int max_iterations = 30;
};

/// Outcome of the search for an orbit.
enum class ShootingEnd : std::uint8_t {
    closed,                ///< the orbit has closed to the tolerance
    equilibrium,           ///< the motion stands still: closed, but no orbit
    iteration_limit,       ///< `Shooting::max_iterations` corrections were made
    stalled,               ///< no correction, however small, brings the ends closer
    run_ended,             ///< the run from the guess does not last a whole period
    other_mode,            ///< the guess ends in another mode or dimension
    undefined_derivative,  ///< the guess meets an event through which there is no derivative
};

/// The enumerator's name, e.g. "closed".
[[nodiscard]] std::string_view name(ShootingEnd end) noexcept;

/// One sentence, with the remedy where there is one.
[[nodiscard]] std::string_view describe(ShootingEnd end) noexcept;

/// The orbit found, or the best approximation of it.
template <class X>
struct PeriodicOrbit {
    bool converged = false;
    ShootingEnd end = ShootingEnd::run_ended;
    X x{};                ///< a point of the orbit
    double period = 0;    ///< [s]
    double residual = 0;  ///< largest |x(T) - x| / max(1, |x|)
    int iterations = 0;   ///< corrections made
    /// Derivative of x(T) with respect to x; NaN if it does not exist.
    Eigen::MatrixXd monodromy{};
    /// Its eigenvalues, the largest first. For an autonomous system one of them is 1: the
    /// direction along the orbit. The orbit attracts if all others are inside the unit
    /// circle; one is 0 for each dimension that sticking removes.
    Eigen::VectorXcd multipliers{};
    Run<X> run{};  ///< one period from x
};

/// @throws std::invalid_argument naming the member, what was given and what was expected.
void validate(const Shooting& shooting);

namespace detail {

/// One shot: the end of a run over one period, and its derivative.
struct Shot {
    ShootingEnd problem = ShootingEnd::closed;  ///< `closed`: none
    Eigen::VectorXd end{};                      ///< x(T)
    Eigen::MatrixXd monodromy{};                ///< NaN where undefined
    Eigen::VectorXd start_rate{};               ///< f at x0
    Eigen::VectorXd end_rate{};                 ///< f at x(T)
};

struct ShotOrbit {
    ShootingEnd end = ShootingEnd::run_ended;
    Eigen::VectorXd x{};
    double period = 0;
    double residual = std::numeric_limits<double>::quiet_NaN();
    int iterations = 0;
    Eigen::MatrixXd monodromy{};
    Eigen::VectorXcd multipliers{};
};

/// The search itself; `shoot(x, period)` runs one period from x.
[[nodiscard]] ShotOrbit shoot_orbit(
    const std::function<Shot(const Eigen::VectorXd&, double)>& shoot, const Eigen::VectorXd& guess,
    const Shooting& shooting);

/// Converts x to an Eigen vector.
template <class X>
[[nodiscard]] Eigen::VectorXd vector_of(const X& x)
{
    Eigen::VectorXd v(static_cast<Eigen::Index>(x.size()));
    for_each_component(x, [&](auto i) { v[static_cast<Eigen::Index>(i)] = x[i]; });
    return v;
}

template <class X>
[[nodiscard]] X state_from(const Eigen::VectorXd& v)
{
    X x = state_of_size<X>(static_cast<std::size_t>(v.size()));
    for_each_component(x, [&](auto i) { x[i] = v[static_cast<Eigen::Index>(i)]; });
    return x;
}

template <class X>
[[nodiscard]] ShootingEnd problem_of(const Sensitivities<X>& s, Mode mode, std::size_t components)
{
    if (s.run.outcome != Outcome::reached_end) return ShootingEnd::run_ended;
    const auto ends_with = static_cast<std::size_t>(s.run.x.size());
    if (s.run.mode != mode || ends_with != components) return ShootingEnd::other_mode;
    if (!s.state.allFinite()) return ShootingEnd::undefined_derivative;
    return ShootingEnd::closed;
}

}  // namespace detail

/// Searches for a periodic orbit near `guess`, in the mode `options.mode`, at the time
/// `options.t_start`. The start should lie away from the event surfaces.
///
/// A correction that does not bring the ends of the orbit closer, or that changes the
/// period by more than a quarter, is halved, up to seven times. Failures of the motion never throw:
/// `end` says how the search ended, and the best orbit found is returned.
///
/// @param options  `t_end` is not used; `rtol` and `atol` well below the tolerance of
///                 the orbit
/// @throws std::invalid_argument for an invalid guess, period or option.
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] PeriodicOrbit<X> find_periodic_orbit(const System& system, const X& guess,
                                                   const Shooting& shooting, const Options& options,
                                                   const Stepping& stepping = {},
                                                   const Detector& detector = {},
                                                   const Locator& locator = {})
{
    validate(shooting);
    const auto run_from = [&](const X& x, double period) {
        Options one = options;
        one.t_end = options.t_start + period;
        return sensitivities(system, x, {}, one, stepping, detector, locator);
    };
    const auto rate_at = [&](Mode mode, double t, const X& x) {
        X rate = x;
        detail::call_flow(system, mode, t, x, rate);
        return detail::vector_of(rate);
    };
    bool first = true;
    const auto shoot = [&](const Eigen::VectorXd& v, double period) -> detail::Shot {
        const X x = detail::state_from<X>(v);
        try {
            const auto s = run_from(x, period);
            first = false;
            return {.problem =
                        detail::problem_of(s, options.mode, static_cast<std::size_t>(guess.size())),
                    .end = detail::vector_of(s.run.x),
                    .monodromy = s.state,
                    .start_rate = rate_at(options.mode, options.t_start, x),
                    .end_rate = rate_at(s.run.mode, s.run.t, s.run.x)};
        } catch (const std::invalid_argument&) {
            // A correction may lead to a point from which no run can start; a guess may not.
            if (first) throw;
            return {.problem = ShootingEnd::run_ended};
        }
    };
    const detail::ShotOrbit found = detail::shoot_orbit(shoot, detail::vector_of(guess), shooting);

    PeriodicOrbit<X> orbit{.converged = found.end == ShootingEnd::closed,
                           .end = found.end,
                           .x = detail::state_from<X>(found.x),
                           .period = found.period,
                           .residual = found.residual,
                           .iterations = found.iterations,
                           .monodromy = found.monodromy,
                           .multipliers = found.multipliers};
    orbit.run = run_from(orbit.x, orbit.period).run;
    return orbit;
}

}  // namespace ricochet
