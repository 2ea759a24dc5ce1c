// Internal: what it declares may change without notice.
//
// Stages by the semismooth Newton method, for sets of any shape.
#pragma once

#include "ricochet/detail/semismooth_newton.hpp"
#include "ricochet/detail/inclusion_stage.hpp"

namespace ricochet::detail {

/// Equation and law of a stage as one system in x = (w, reaction):
///
///     (c A w - kappa f - sigma G reaction - q) / scale
///     sigma (reaction - P(reaction - rho y)) / scale
///
/// with the derivative of a bound by the state where the system declares it, and without
/// it as if the bound were constant: the iteration then converges linearly.
template <class System>
class StageNewton {
public:
    static constexpr int N = state_size<System>;
    static constexpr int M = reaction_size<System>;
    static constexpr int size =
        N == Eigen::Dynamic || M == Eigen::Dynamic ? Eigen::Dynamic : N + M;
    using Vector = Eigen::Matrix<double, size, 1>;
    using Matrix = Eigen::Matrix<double, size, size>;

    explicit StageNewton(const InclusionMatrices<System>& m)
    {
        const Eigen::Index n = m.size();
        const Eigen::Index k = m.reactions();
        x_.setZero(n + k);
        v_.setZero(n + k, n + k);
        slope_.setZero(k, k);
        gradient_.setZero(n);
        scratch_.f = scratch_.direction = scratch_.trial = scratch_.f_trial = x_;
        w_.setZero(n);
        reaction_.setZero(k);
    }

    [[nodiscard]] StageReport solve(StageScratch<System>& scratch,
                                    const detail::Stage<System>& stage, const StageOptions& options,
                                    StateOf<System>& w, ReactionOf<System>& reaction)
    {
        scratch_of_stage_ = &scratch;
        stage_ = &stage;
        const auto& m = scratch.m;
        m.offset(stage.t, scratch.s);
        const auto& factor = scratch.factor(stage, w);
        scratch.set_rho(factor);
        m.smooth(stage.t, w, scratch.f);
        scale_ = std::max({(stage.c * (m.mass() * w)).template lpNorm<Eigen::Infinity>(),
                           stage.kappa * scratch.f.template lpNorm<Eigen::Infinity>(),
                           stage.q.template lpNorm<Eigen::Infinity>(),
                           std::numeric_limits<double>::min()});
        x_.head(w.size()) = w;
        x_.tail(reaction.size()) = reaction;
        // Slightly below, since this scale is that of the start.
        const NewtonReport newton = semismooth_newton(
            *this, x_,
            {.tolerance = options.tolerance / 4,
             .max_iterations = options.max_iterations,
             .line_search = options.line_search},
            scratch_);
        w = x_.head(w.size());
        reaction = x_.tail(reaction.size());
        m.smooth(stage.t, w, scratch.f);
        StageReport report = scratch.residual(stage, m.system().reaction_set(stage.t, w), w,
                                              scratch.f, reaction);
        report.iterations = newton.iterations;
        report.converged = report.residual <= options.tolerance;
        return report;
    }

    void residual(const Vector& x, Vector& f)
    {
        auto& s = *scratch_of_stage_;
        take_apart(x);
        s.m.smooth(stage_->t, w_, s.f_trial);
        (void)s.residual(*stage_, s.m.system().reaction_set(stage_->t, w_), w_, s.f_trial,
                         reaction_);
        f.head(w_.size()) = s.defect / scale_;
        f.tail(reaction_.size()) = (stage_->sigma / scale_) * s.image;
    }

    [[nodiscard]] bool direction(const Vector& x, const Vector& f, Vector& d)
    {
        auto& s = *scratch_of_stage_;
        take_apart(x);
        const Eigen::Index n = w_.size();
        const Eigen::Index k = reaction_.size();
        const auto set = s.m.system().reaction_set(stage_->t, w_);
        if (!fault_of(set).empty()) return false;
        // A box's law has one slope per row; `argument` is where the projection was taken.
        s.m.smooth(stage_->t, w_, s.f_trial);
        (void)s.residual(*stage_, set, w_, s.f_trial, reaction_);
        set.derivative(span_of(s.argument), {slope_.data(), static_cast<std::size_t>(k * k)});
        auto& jacobian = s.factors[0].jacobian;
        s.m.jacobian(stage_->t, w_, jacobian);
        v_.topLeftCorner(n, n) = stage_->c * s.m.mass() - stage_->kappa * jacobian;
        v_.topRightCorner(n, k) = -stage_->sigma * s.m.act();
        constexpr bool of_reactions = confines<System>() == Confines::reaction;
        const auto by_y = of_reactions ? Confines::reaction : Confines::state;
        for (Eigen::Index i = 0; i < k; ++i) {
            for (Eigen::Index j = 0; j < k; ++j) {
                const double unit = i == j ? 1 : 0;
                // Row-major in memory, hence slope_(j, i).
                const double p = slope_(j, i);
                v_(n + i, n + j) =
                    by_y == Confines::reaction ? unit - p : -s.rho[i] * p / s.rho[j];
            }
            v_.row(n + i).head(n).setZero();
            for (Eigen::Index j = 0; j < k; ++j) {
                const double unit = i == j ? 1 : 0;
                const double p = slope_(j, i);
                const double factor = by_y == Confines::reaction ? p * s.rho[j] : s.rho[i] * (p - unit);
                v_.row(n + i).head(n) += factor * s.m.observe().row(j);
            }
            if constexpr (HasBoundGradient<System> && BoxSet<SetOf<System>>) {
                add_bound_gradient(set, i, s);
            }
            v_.row(n + i) *= stage_->sigma;
        }
        if constexpr (is_affine<System>()) s.factors[0].valid = false;
        // Undamped directions at kinks can be singular; the search would stall there.
        return dense_direction(v_, lu_, Vector(f * scale_), d);
    }

    /// The generalised Jacobian of the last direction, for tests.
    [[nodiscard]] const Matrix& jacobian() const noexcept { return v_; }

private:
    void take_apart(const Vector& x)
    {
        w_ = x.head(w_.size());
        reaction_ = x.tail(reaction_.size());
    }

    template <class Set>
    void add_bound_gradient(const Set& set, Eigen::Index i, StageScratch<System>& s)
    {
        const auto k = static_cast<std::size_t>(i);
        const double z = s.argument[i];
        const double side = z > set.upper(k) ? 1 : z < set.lower(k) ? -1 : 0;
        if (side == 0) return;
        s.m.system().bound_gradient(stage_->t, w_, static_cast<int>(i), gradient_);
        v_.row(w_.size() + i).head(w_.size()) -= side * gradient_.transpose();
    }

    StageScratch<System>* scratch_of_stage_ = nullptr;
    const detail::Stage<System>* stage_ = nullptr;
    double scale_ = 1;
    Vector x_;
    Matrix v_;
    Eigen::PartialPivLU<Matrix> lu_;
    Eigen::Matrix<double, M, M> slope_;
    StateOf<System> w_, gradient_;
    ReactionOf<System> reaction_;
    NewtonScratch<Vector> scratch_;
};

}  // namespace ricochet::detail
