// Time stepping of mechanical systems with impacts and friction (Moreau and Jean).
//
//     M(q) dv = F(t, q, v) dt + H(q)' dp,    q' = v
//
// Impacts are not located: a step ends with the velocities that Newton's law of impact
// and Coulomb's law of friction allow, for all contacts together, however many of them have
// closed within it. The order is 1, and positions may go behind their
// constraints by a step times their velocity; but no impacts can accumulate or be missed.
//
// A system is a value with
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
#pragma once

#include <Eigen/Dense>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "ricochet/detail/any_mechanism.hpp"
#include "ricochet/detail/contact_problem.hpp"
#include "ricochet/detail/inclusion_sizes.hpp"
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

}  // namespace detail

/// Counts over one motion by time stepping.
struct TimeSteppingStatistics {
    std::uint64_t steps = 0;
    std::uint64_t problems = 0;    ///< steps with a closed contact
    std::uint64_t iterations = 0;  ///< iterations of Newton's method in them
    std::uint64_t sweeps = 0;
    std::uint64_t unsolved = 0;  ///< steps that were repeated at half the length
};

namespace detail {

/// `TimeStepping` for systems of any type.
template <int N>
class RICOCHET_ALIGNED AnyTimeStepping {
public:
    using Vector = Eigen::Matrix<double, N, 1>;
    using Square = Eigen::Matrix<double, N, N>;

    struct State {
        double t = 0;
        Vector q, v;
        Eigen::VectorXd impulse;  ///< of the last step [N s], normal first; zero where open
    };

    AnyTimeStepping(const AnyMechanism<N>& system, const Vector& q, const Vector& v,
                    const TimeSteppingOptions& options);

    /// Restarts from (t, q, v), when an integrator of free flight hands over.
    /// @throws std::invalid_argument for a time, position or velocity that is not finite.
    void restart(double t, const Vector& q, const Vector& v);

    [[nodiscard]] const State& state() const noexcept { return state_; }
    [[nodiscard]] const TimeSteppingStatistics& statistics() const noexcept { return statistics_; }
    [[nodiscard]] Outcome outcome() const noexcept { return outcome_; }
    /// The contact problem that ended the run as `not_converged`; its residual is infinite and
    /// its contact -1 where a force, a gap, a direction or the velocity was not finite.
    [[nodiscard]] const ContactReport& failure() const noexcept { return failure_; }

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
    static void check_start(double t, const Vector& q, const Vector& v)
    {
        if (!std::isfinite(t)) refuse_inclusion("the time at the start must be finite, not", t);
        if (!q.allFinite()) refuse_inclusion("the initial position is not finite");
        if (!v.allFinite()) refuse_inclusion("the initial velocity is not finite");
    }

    bool take(double h)
    {
        middle_ = state_.q + (h / 2) * state_.v;
        system_->mass(middle_, mass_);
        system_->force(state_.t + h / 2, middle_, state_.v, force_);
        system_->gaps(middle_, gaps_);
        factor_.compute(mass_);
        velocity_ = state_.v + h * factor_.solve(force_);
        if (factor_.info() != Eigen::Success || !velocity_.allFinite() || gaps_.hasNaN()) {
            return fail_finite();
        }
        closed_.clear();
        for (int c = 0; c < system_->contacts; ++c) {
            if (gaps_[c] <= 0) closed_.push_back(c);
        }
        impulse_.setZero();
        if (!closed_.empty() && !collide()) return false;
        if (!velocity_.allFinite()) return fail_finite();
        state_.v = velocity_;
        state_.q = middle_ + (h / 2) * velocity_;
        state_.t += h;
        state_.impulse = impulse_;
        return true;
    }

    bool fail_finite()
    {
        failure_ = {.residual = std::numeric_limits<double>::infinity()};
        return false;
    }

    bool collide()
    {
        ++statistics_.problems;
        system_->directions(middle_, directions_);
        const int D = system_->components;
        const auto n = static_cast<Eigen::Index>(closed_.size()) * D;
        h_.resize(n, N);
        friction_.clear();
        for (std::size_t k = 0; k < closed_.size(); ++k) {
            const int c = closed_[k];
            h_.middleRows(static_cast<Eigen::Index>(k) * D, D) = directions_.middleRows(c * D, D);
            friction_.push_back(system_->friction(c));
        }
        inverse_ = factor_.solve(h_.transpose());
        w_.noalias() = h_ * inverse_;
        q_.noalias() = h_ * velocity_;
        p_.setZero(n);
        for (std::size_t k = 0; k < closed_.size(); ++k) {
            const auto row = static_cast<Eigen::Index>(k) * D;
            q_[row] += system_->restitution(closed_[k]) * h_.row(row).dot(state_.v);
            p_.segment(row, D) = state_.impulse.segment(closed_[k] * D, D);
        }
        if (!w_.allFinite() || !q_.allFinite()) return fail_finite();
        const ContactReport report = solver_.solve(w_, q_, friction_, D, p_);
        statistics_.iterations += static_cast<std::uint64_t>(report.iterations);
        statistics_.sweeps += static_cast<std::uint64_t>(report.sweeps);
        if (!report.converged) {
            failure_ = report;
            if (report.contact >= 0)
                failure_.contact = closed_[static_cast<std::size_t>(report.contact)];
            return false;
        }
        velocity_.noalias() += inverse_ * p_;
        for (std::size_t k = 0; k < closed_.size(); ++k) {
            const Eigen::Index first = static_cast<Eigen::Index>(closed_[k]) * D;
            impulse_.segment(first, D) = p_.segment(static_cast<Eigen::Index>(k) * D, D);
        }
        return true;
    }

    Owned<AnyMechanism<N>> system_;
    TimeSteppingOptions options_;
    ContactSolver solver_;
    State state_;
    Vector middle_, force_, velocity_;
    Square mass_;
    Eigen::LLT<Square> factor_;
    Eigen::VectorXd gaps_, impulse_;
    typename AnyMechanism<N>::Directions directions_;
    Eigen::Matrix<double, Eigen::Dynamic, N> h_;
    Eigen::Matrix<double, N, Eigen::Dynamic> inverse_;
    Eigen::MatrixXd w_;
    Eigen::VectorXd q_, p_;
    std::vector<int> closed_;
    std::vector<double> friction_;
    TimeSteppingStatistics statistics_;
    ContactReport failure_;
    Outcome outcome_ = Outcome::running;
};

template <int N>
AnyTimeStepping<N>::AnyTimeStepping(const AnyMechanism<N>& system, const Vector& q, const Vector& v,
                                    const TimeSteppingOptions& options)
    : system_(system), options_(options), solver_(options.contacts)
{
    validate(options);
    check_start(options.t_start, q, v);
    system_->gaps(q, gaps_);
    for (int c = 0; c < system_->contacts; ++c) {
        check_contact(c, system_->restitution(c), system_->friction(c), gaps_[c],
                      1e-12 * (1 + q.norm()));
    }
    system_->mass(q, mass_);
    if (!mass_.allFinite() || Eigen::LLT<Square>(mass_).info() != Eigen::Success) {
        refuse_inclusion("the mass matrix is not positive definite");
    }
    system_->directions(q, directions_);
    for (int c = 0; c < system_->contacts; ++c) {
        check_direction(c, directions_.row(c * system_->components), q,
                        [&](const Eigen::VectorXd& at) { return system_->gap(c, at); });
    }
    friction_.reserve(static_cast<std::size_t>(system.contacts));
    closed_.reserve(static_cast<std::size_t>(system.contacts));
    restart(options.t_start, q, v);
}

template <int N>
void AnyTimeStepping<N>::restart(double t, const Vector& q, const Vector& v)
{
    check_start(t, q, v);
    impulse_.setZero(system_->contacts * system_->components);
    state_ = {t, q, v, impulse_};
    outcome_ = t < options_.t_end ? Outcome::running : Outcome::reached_end;
}

template <int N>
Outcome AnyTimeStepping<N>::advance()
{
    if (outcome_ != Outcome::running) return outcome_;
    const double left = options_.t_end - state_.t;
    double h = options_.step;
    bool last = is_last_step(h, state_.t, options_.t_end, statistics_.steps);
    if (last) h = left;
    // Another length gives another problem, which may be easier.
    for (int attempt = 0; !take(h); ++attempt) {
        if (attempt == 10) return outcome_ = Outcome::not_converged;
        ++statistics_.unsolved;
        h /= 2;
        last = false;
    }
    ++statistics_.steps;
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
