// Internal: the declarations of this header may change without notice.
//
// A step of Moreau's midpoint rule, from a state that it does not change.
#pragma once

#include <Eigen/Dense>

#include <cstdint>
#include <limits>
#include <vector>

#include "ricochet/nonsmooth/contact_problem.hpp"
#include "ricochet/nonsmooth/contact_results.hpp"
#include "ricochet/nonsmooth/detail/any_mechanism.hpp"

namespace ricochet::detail {

/// How often a step is halved whose contact problem is not solved: another length gives another
/// problem, which may be easier.
inline constexpr int most_halvings = 10;

/// The rule, see time_stepping.hpp. Dry friction of a coordinate is a contact of its own, whose
/// normal impulse the step prescribes, with a coefficient of 1.
template <int N>
class RICOCHET_ALIGNED MoreauStep {
public:
    using Vector = Eigen::Matrix<double, N, 1>;
    using Square = Eigen::Matrix<double, N, N>;

    struct State {
        double t = 0;
        Vector q, v;
        Eigen::VectorXd impulse;   ///< of the last step [N s], normal first; zero where open
        Eigen::VectorXd friction;  ///< the same of `dry`, in its order
    };

    MoreauStep(const AnyMechanism<N>& system, const ContactOptions& contacts)
        : system_(system), solver_(contacts), dry_(dry_frictions(system))
    {
        const auto most = static_cast<std::size_t>(system.contacts) + dry_.size();
        closed_.reserve(most);
        coefficients_.reserve(most);
    }

    [[nodiscard]] const AnyMechanism<N>& system() const noexcept { return *system_; }
    [[nodiscard]] const std::vector<DryFriction>& dry() const noexcept { return dry_; }
    [[nodiscard]] TimeSteppingStatistics& statistics() noexcept { return statistics_; }
    [[nodiscard]] const TimeSteppingStatistics& statistics() const noexcept { return statistics_; }
    /// The contact problem of the last step that had no solution; its residual is infinite and
    /// its contact -1 where a force, a gap, a direction or the velocity was not finite.
    [[nodiscard]] const ContactReport& failure() const noexcept { return failure_; }

    /// A state before which nothing has pushed.
    [[nodiscard]] State start(double t, const Vector& q, const Vector& v) const
    {
        return {t, q, v, Eigen::VectorXd::Zero(system_->contacts * system_->components),
                Eigen::VectorXd::Zero(static_cast<Eigen::Index>(dry_.size()))};
    }

    /// Steps from a state to another; false where that is impossible. `to` is then undefined.
    [[nodiscard]] bool take(Mode mode, const State& from, double h, State& to)
    {
        middle_ = from.q + (h / 2) * from.v;
        const double t_middle = from.t + h / 2;
        system_->mass(middle_, mass_);
        system_->force({mode, t_middle}, middle_, from.v, force_);
        system_->gaps(t_middle, middle_, gaps_);
        factor_.compute(mass_);
        velocity_ = from.v + h * factor_.solve(force_);
        if (factor_.info() != Eigen::Success || !velocity_.allFinite() || gaps_.hasNaN()) {
            return fail_finite();
        }
        closed_.clear();
        for (int c = 0; c < system_->contacts; ++c) {
            if (gaps_[c] <= 0) closed_.push_back(c);
        }
        to.impulse.setZero(system_->contacts * system_->components);
        to.friction.setZero(static_cast<Eigen::Index>(dry_.size()));
        if ((!closed_.empty() || !dry_.empty()) && !collide(from, h, to)) return false;
        if (!velocity_.allFinite()) return fail_finite();
        to.v = velocity_;
        to.q = middle_ + (h / 2) * velocity_;
        to.t = from.t + h;
        return true;
    }

private:
    bool fail_finite()
    {
        failure_ = {.residual = std::numeric_limits<double>::infinity()};
        return false;
    }

    bool collide(const State& from, double h, State& to)
    {
        ++statistics_.problems;
        system_->directions(from.t + h / 2, middle_, directions_);
        list_rows();
        inverse_ = factor_.solve(h_.transpose());
        w_.noalias() = h_ * inverse_;
        q_.noalias() = h_ * velocity_;
        p_.setZero(h_.rows());
        for (std::size_t k = 0; k < closed_.size(); ++k) {
            const Eigen::Index row = row_of(k);
            q_[row] += system_->restitution(closed_[k]) * h_.row(row).dot(from.v);
            p_.segment(row, components()) = from.impulse.segment(first_of(k), components());
        }
        if (system_->moves) add_surface_rates(from.t, h);
        for (std::size_t k = 0; k < dry_.size(); ++k) prescribe_friction(k, from, h);
        if (!w_.allFinite() || !q_.allFinite()) return fail_finite();
        const ContactReport report = solver_.solve(w_, q_, coefficients_, system_->components, p_);
        statistics_.iterations += static_cast<std::uint64_t>(report.iterations);
        statistics_.sweeps += static_cast<std::uint64_t>(report.sweeps);
        if (!report.converged) {
            failure_ = report;
            const auto worst = static_cast<std::size_t>(report.contact);
            failure_.contact = worst < closed_.size() ? closed_[worst] : -1;
            return false;
        }
        velocity_.noalias() += inverse_ * p_;
        for (std::size_t k = 0; k < closed_.size(); ++k) {
            to.impulse.segment(first_of(k), components()) = p_.segment(row_of(k), components());
        }
        for (std::size_t k = 0; k < dry_.size(); ++k) {
            to.friction[static_cast<Eigen::Index>(k)] = p_[row_of(closed_.size() + k) + 1];
        }
        return true;
    }

    [[nodiscard]] Eigen::Index components() const noexcept { return system_->components; }
    /// First row of the k-th contact of the problem; dry friction follows what is closed.
    [[nodiscard]] Eigen::Index row_of(std::size_t k) const noexcept
    {
        return static_cast<Eigen::Index>(k) * components();
    }
    /// First row, among those of all contacts, of the k-th that is closed.
    [[nodiscard]] Eigen::Index first_of(std::size_t k) const noexcept
    {
        return closed_[k] * components();
    }

    /// Writes the directions of the problem's contacts, and their coefficients of friction.
    void list_rows()
    {
        h_.resize(row_of(closed_.size() + dry_.size()), N);
        coefficients_.clear();
        for (std::size_t k = 0; k < closed_.size(); ++k) {
            h_.middleRows(row_of(k), components()) =
                directions_.middleRows(first_of(k), components());
            coefficients_.push_back(system_->friction(closed_[k]));
        }
        for (std::size_t k = 0; k < dry_.size(); ++k) {
            const Eigen::Index row = row_of(closed_.size() + k);
            h_.middleRows(row, components()).setZero();
            h_(row + 1, dry_[k].coordinate) = 1;
            coefficients_.push_back(1);
        }
    }

    /// Velocities before the step are relative to surfaces at its start, those after it at its end.
    void add_surface_rates(double t, double h)
    {
        system_->surface_rates(t, middle_, rates_before_);
        system_->surface_rates(t + h, middle_, rates_);
        for (std::size_t k = 0; k < closed_.size(); ++k) {
            const Eigen::Index row = row_of(k), first = first_of(k);
            q_.segment(row, components()) += rates_.segment(first, components());
            q_[row] += system_->restitution(closed_[k]) * rates_before_[first];
        }
    }

    /// The equation of the normal impulse, which nothing else enters, becomes p = h F.
    void prescribe_friction(std::size_t k, const State& from, double h)
    {
        const Eigen::Index row = row_of(closed_.size() + k);
        w_(row, row) = w_(row + 1, row + 1);
        q_[row] = -w_(row, row) * (h * dry_[k].force);
        p_[row] = h * dry_[k].force;
        p_[row + 1] = from.friction[static_cast<Eigen::Index>(k)];
    }

    Owned<AnyMechanism<N>> system_;
    ContactSolver solver_;
    std::vector<DryFriction> dry_;
    Vector middle_, force_, velocity_;
    Square mass_;
    Eigen::LLT<Square> factor_;
    Eigen::VectorXd gaps_, rates_, rates_before_;
    typename AnyMechanism<N>::Directions directions_;
    Eigen::Matrix<double, Eigen::Dynamic, N> h_;
    Eigen::Matrix<double, N, Eigen::Dynamic> inverse_;
    Eigen::MatrixXd w_;
    Eigen::VectorXd q_, p_;
    std::vector<int> closed_;
    std::vector<double> coefficients_;
    TimeSteppingStatistics statistics_;
    ContactReport failure_;
};

}  // namespace ricochet::detail
