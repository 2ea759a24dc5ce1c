// Time stepping of mechanical systems with impacts and friction (Moreau and Jean).
//
//     M(q) dv = F(t, q, v) dt + H(q)' dp,    q' = v
//
// Impacts are not located: a step ends with the velocities that Newton's law of impact
// and Coulomb's law of friction allow, for all contacts together, however many of them have
// closed within it. The order is 1, and positions may go behind their
// constraints by a step times their velocity; but no impacts can accumulate or be missed.
//
// A mechanism is a value with
//
//     coordinates, contacts      static constexpr int
//     tangents                   static constexpr int, 1 or 2 per contact
//     mass(q, M)                 symmetric, positive definite
//     force(t, q, v, F)
//     gaps(q, g)                 one per contact; open where positive
//     directions(q, H)           for each contact the row of its gap's rate, then those of
//                                its tangential velocities
//     restitution(c)             Newton's coefficient of contact c, in [0, 1]
//     friction(c)                Coulomb's coefficient, finite, zero or positive
//
// and, where it has them,
//
//     gaps(t, q, g), directions(t, q, H)    surfaces that move; then also
//     surface_rates(t, q, b)     relative velocities of the contacts where v = 0, in the order of
//                                the rows of H: dg/dt, and velocities of slip
//     dry_friction(i)            force of constant dry friction of coordinate i, zero or positive
#pragma once

#include <Eigen/Dense>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "ricochet/nonsmooth/detail/any_mechanism.hpp"
#include "ricochet/nonsmooth/detail/inclusion_sizes.hpp"
#include "ricochet/nonsmooth/detail/moreau_step.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"

namespace ricochet {

/// Options of time stepping.
struct TimeSteppingOptions {
    double t_start = 0;
    double t_end = std::numeric_limits<double>::quiet_NaN();
    double step = 0;  ///< [s] length of the steps, positive
    ContactOptions contacts{};
};

/// Validates the options. An empty interval of time is accepted.
///
/// @throws std::invalid_argument naming the option.
void validate(const TimeSteppingOptions& options);

namespace detail {

/// Validates a contact. @throws std::invalid_argument, naming the contact, if a coefficient is out
/// of range, or if the gap is NaN or below -`room` [m].
void check_contact(int contact, double restitution, double friction, double gap, double room);

/// Validates the first row of `directions` for a contact, `row`, against the gradient of its gap in
/// the position q, by differences over the one of several lengths at which both sides agree best;
/// at a kink the row may lie between the slopes on its sides.
///
/// @param gap  of the contact in a position [m]
/// @throws std::invalid_argument, naming the contact, if it disagrees.
void check_direction(int contact, const Eigen::VectorXd& row, const Eigen::VectorXd& q,
                     const std::function<double(const Eigen::VectorXd&)>& gap);

/// The same for the rate of a gap in a position that stands still, by differences ahead of t.
void check_surface_rate(int contact, double rate, double t,
                        const std::function<double(double)>& gap);

}  // namespace detail

namespace detail {

/// @throws std::invalid_argument for a time, position or velocity that is not finite.
template <class Vector>
void check_finite(double t, const Vector& q, const Vector& v)
{
    if (!std::isfinite(t)) refuse_inclusion("the time at the start must be finite, not", t);
    if (!q.allFinite()) refuse_inclusion("the initial position is not finite");
    if (!v.allFinite()) refuse_inclusion("the initial velocity is not finite");
}

/// Refuses what no mechanism may start with, at time t. @throws std::invalid_argument
template <int N>
void check_start(const AnyMechanism<N>& system, double t, const Eigen::Matrix<double, N, 1>& q,
                 const Eigen::Matrix<double, N, 1>& v)
{
    check_finite(t, q, v);
    Eigen::VectorXd gaps;
    system.gaps(t, q, gaps);
    for (int c = 0; c < system.contacts; ++c) {
        check_contact(c, system.restitution(c), system.friction(c), gaps[c],
                      1e-12 * (1 + q.norm()));
    }
    Eigen::Matrix<double, N, N> mass;
    system.mass(q, mass);
    if (!mass.allFinite() ||
        Eigen::LLT<Eigen::Matrix<double, N, N>>(mass).info() != Eigen::Success) {
        refuse_inclusion("the mass matrix is not positive definite");
    }
    typename AnyMechanism<N>::Directions directions;
    Eigen::VectorXd rates;
    system.directions(t, q, directions);
    if (system.moves) system.surface_rates(t, q, rates);
    for (int c = 0; c < system.contacts; ++c) {
        const int row = c * system.components;
        check_direction(c, directions.row(row), q,
                        [&](const Eigen::VectorXd& at) { return system.gap(c, t, at); });
        if (!system.moves) continue;
        check_surface_rate(c, rates[row], t, [&](double at) { return system.gap(c, at, q); });
    }
}

/// `TimeStepping` for systems of any type.
template <int N>
class RICOCHET_ALIGNED AnyTimeStepping {
public:
    using Vector = Eigen::Matrix<double, N, 1>;
    using Square = Eigen::Matrix<double, N, N>;
    using State = typename MoreauStep<N>::State;

    AnyTimeStepping(const AnyMechanism<N>& system, const Vector& q, const Vector& v,
                    const TimeSteppingOptions& options)
        : options_(options), step_(system, options.contacts)
    {
        validate(options);
        check_start(system, options.t_start, q, v);
        next_ = step_.start(options_.t_start, q, v);
        restart(options_.t_start, q, v);
    }

    /// Restarts from (t, q, v).
    /// @throws std::invalid_argument for a time, position or velocity that is not finite.
    void restart(double t, const Vector& q, const Vector& v)
    {
        check_finite(t, q, v);
        state_ = step_.start(t, q, v);
        outcome_ = t < options_.t_end ? Outcome::running : Outcome::reached_end;
    }

    [[nodiscard]] const State& state() const noexcept { return state_; }
    [[nodiscard]] const TimeSteppingStatistics& statistics() const noexcept
    {
        return step_.statistics();
    }
    [[nodiscard]] Outcome outcome() const noexcept { return outcome_; }
    /// The contact problem that ended the run as `not_converged`; its residual is infinite and
    /// its contact -1 where a force, a gap, a direction or the velocity was not finite.
    [[nodiscard]] const ContactReport& failure() const noexcept { return step_.failure(); }

    Outcome advance();

    template <class Observer>
    Outcome run(const Observer& observer)
    {
        observer(std::as_const(state_));
        if (outcome_ != Outcome::running) return outcome_;
        while (advance() == Outcome::running) observer(std::as_const(state_));
        if (outcome_ == Outcome::reached_end) observer(std::as_const(state_));
        return outcome_;
    }
    Outcome run()
    {
        return run([](const State&) {});
    }

private:
    [[nodiscard]] bool take(double h)
    {
        if (!step_.take(0, state_, h, next_)) return false;
        std::swap(state_, next_);
        return true;
    }

    TimeSteppingOptions options_;
    MoreauStep<N> step_;
    State state_, next_;
    Outcome outcome_ = Outcome::running;
};

template <int N>
Outcome AnyTimeStepping<N>::advance()
{
    if (outcome_ != Outcome::running) return outcome_;
    TimeSteppingStatistics& counts = step_.statistics();
    const double left = options_.t_end - state_.t;
    double h = options_.step;
    bool last = is_last_step(h, state_.t, options_.t_end, counts.steps);
    if (last) h = left;
    // Another length gives another problem, which may be easier.
    for (int attempt = 0; !take(h); ++attempt) {
        if (attempt == most_halvings) return outcome_ = Outcome::not_converged;
        ++counts.unsolved;
        h /= 2;
        last = false;
    }
    ++counts.steps;
    if (last) {
        state_.t = options_.t_end;
        outcome_ = Outcome::reached_end;
    }
    return outcome_;
}

}  // namespace detail

/// Moreau's midpoint rule:
///
///     q_m = q + h/2 v,   contacts closed: g(q_m) <= 0
///     v+ = v + M^-1 (h F(t_m, q_m, v) + H' p)
///     0 <= p_n,  u_n+ + e u_n- >= 0, complementary;  friction on u_t+
///     q+ = q_m + h/2 v+
///
/// (J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988;
/// M. Jean, The non-smooth contact dynamics method, Computer Methods in Applied
/// Mechanics and Engineering 177, 1999.)
///
/// Memory is allocated only when the number of closed contacts changes.
template <class System>
class TimeStepping : public detail::AnyTimeStepping<System::coordinates> {
public:
    static constexpr int N = System::coordinates;
    static constexpr int C = System::contacts;
    static constexpr int D = 1 + System::tangents;
    using Vector = Eigen::Matrix<double, N, 1>;
    using Gaps = Eigen::Matrix<double, C, 1>;
    using Directions = Eigen::Matrix<double, C * D, N>;
    using Impulses = Eigen::Matrix<double, C * D, 1>;

    /// @throws std::invalid_argument for invalid options, a matrix that is not positive definite,
    /// coefficients out of range, a start that is not finite or inside an obstacle by more than
    /// rounding, or a direction that is not the gradient of its gap there.
    TimeStepping(const System& system, const Vector& q, const Vector& v,
                 const TimeSteppingOptions& options)
        : TimeStepping::AnyTimeStepping(detail::TypedMechanism<System>(system), q, v, options)
    {
    }
};

}  // namespace ricochet

#if RICOCHET_ALIGNED_AS_LIBRARY
RICOCHET_TIME_STEPPING_OF(2, extern)
RICOCHET_TIME_STEPPING_OF(3, extern)
#endif
