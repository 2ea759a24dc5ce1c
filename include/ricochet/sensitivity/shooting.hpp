// Periodic orbits by shooting.
//
// A periodic orbit is a root of x(T; x0) - x0. Newton's method takes its Jacobian,
// M - I, from the monodromy matrix M through all events; where the period is not known
// either, a column f(x(T)) and the row f(guess) of a phase condition border it, so that
// corrections are taken across the orbit:
//
//     ( M - I      f(x(T)) ) ( dx )     ( x(T) - x0 )
//     ( f(guess)'  0       ) ( dT )  = -(     0     )
//
// (R. Seydel, Practical Bifurcation and Stability Analysis, Springer, 2010, chapter 7;
// with events: Leine and Nijmeijer 2004.) Where the orbit is one of a family, as in
// conservative systems, that matrix becomes singular, and full corrections run along the
// family to its end, an equilibrium. With the square of the gap as parameter, those of
// Levenberg and Marquardt do not, and converge as fast (N. Yamashita and M. Fukushima, On
// the rate of convergence of the Levenberg-Marquardt method, Computing Supplementa 15,
// 2001).
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "ricochet/sensitivity/sensitivities.hpp"

namespace ricochet {

/// How an orbit is looked for.
struct Shooting {
    /// [s] Of the orbit, positive; of an autonomous system a first guess.
    double period = std::numeric_limits<double>::quiet_NaN();
    /// The system does not depend on time, and the period is to be found.
    bool autonomous = false;
    /// The orbit has closed when |x(T) - x0| <= tolerance max(1, |x0|) in every
    /// component. What can be reached depends on `Options::rtol` and `atol`.
    double tolerance = 1e-10;
    int max_iterations = 30;
};

/// How the search for an orbit ended.
enum class ShootingEnd : std::uint8_t {
    closed,                ///< the orbit has closed to the tolerance
    equilibrium,           ///< the motion stands still: closed, but no orbit
    iteration_limit,       ///< `Shooting::max_iterations` corrections were made
    stalled,               ///< no correction, however small, brings the ends closer
    run_ended,             ///< the guess has no run over a whole period
    other_mode,            ///< the guess ends in another mode or dimension
    undefined_derivative,  ///< the guess meets an event through which there is no derivative
};

/// The enumerator's name, e.g. "closed".
[[nodiscard]] std::string_view name(ShootingEnd end) noexcept;

/// One sentence, with the remedy where there is one.
[[nodiscard]] std::string_view describe(ShootingEnd end) noexcept;

/// An orbit, or how near the search has come.
template <class X>
struct PeriodicOrbit {
    bool converged = false;
    ShootingEnd end = ShootingEnd::run_ended;
    X x{};                ///< a point of the orbit
    double period = 0;    ///< [s]
    double residual = 0;  ///< largest |x(T) - x| / max(1, |x|)
    int iterations = 0;   ///< corrections made
    /// Derivative of x(T) by x; NaN where it does not exist.
    Eigen::MatrixXd monodromy{};
    /// Its eigenvalues, the largest first. Of an autonomous system one of them is 1: the
    /// direction along the orbit. The orbit attracts if all others are inside the unit
    /// circle; one is 0 for each dimension that sticking takes away.
    Eigen::VectorXcd multipliers{};
    Run<X> run{};  ///< one period from x
};

/// @throws std::invalid_argument naming the member, what was given and expected.
void validate(const Shooting& shooting);

namespace detail {

/// One shot: where a run of a period leads, and its derivative.
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

/// The search itself; `shoot(x, period)` is the run of a period from x.
[[nodiscard]] ShotOrbit shoot_orbit(
    const std::function<Shot(const Eigen::VectorXd&, double)>& shoot, const Eigen::VectorXd& guess,
    const Shooting& shooting);

/// x as an Eigen vector.
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

/// Looks for a periodic orbit near `guess`, in the mode `options.mode`, at the time
/// `options.t_start`. The start should lie away from the surfaces of guards.
///
/// A correction that does not bring the ends of the orbit closer, or that changes the
/// period by more than a quarter, is halved, up to seven times. What the motion does never throws:
/// `end` says how the search ended, and the best orbit found is returned.
///
/// @param options  `t_end` is not used; `rtol` and `atol` well below the tolerance of
///                 the orbit
/// @throws std::invalid_argument for a guess, a period or options that make no sense.
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
            // A correction may lead where no run can start; a guess may not.
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
