// Internal: the declarations of this header may change without notice.
//
// Stages by the semismooth Newton method, for sets of any shape.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "ricochet/nonsmooth/detail/inclusion_stage.hpp"
#include "ricochet/nonsmooth/semismooth_newton.hpp"

namespace ricochet::detail {

/// Equation and law of a stage as one system in x = (w, reaction):
///
///     (c A w - kappa f - sigma G reaction - q) / scale of the row
///     sigma (reaction - P(reaction - rho y)) / scale of the law
///
/// with the derivative of a bound by the state where the system declares it. Without it the
/// bound is treated as constant, and the iteration converges linearly.
template <int N, int M>
class RICOCHET_ALIGNED StageNewton {
public:
    static constexpr int size = N == Eigen::Dynamic || M == Eigen::Dynamic ? Eigen::Dynamic : N + M;
    using State = typename AnyMatrices<N, M>::State;
    using Reaction = typename AnyMatrices<N, M>::Reaction;
    using Vector = Eigen::Matrix<double, size, 1>;
    using Matrix = Eigen::Matrix<double, size, size>;

    explicit StageNewton(const AnyMatrices<N, M>& m)
    {
        const Eigen::Index n = m.size();
        const Eigen::Index k = m.reactions();
        x_.setZero(n + k);
        v_.setZero(n + k, n + k);
        slope_.setZero(k, k);
        gradient_.setZero(n);
        scale_.setOnes(n);
        unscaled_ = x_;
        scratch_.f = scratch_.direction = scratch_.trial = scratch_.f_trial = x_;
        w_.setZero(n);
        reaction_.setZero(k);
    }

    /// Lets Newton's equations, which are singular where dependent reactions hold their y, have the
    /// least changes of reactions.
    void take_as_dependent() noexcept { dependent_ = true; }

    [[nodiscard]] StageReport solve(StageScratch<N, M>& scratch, const Stage<N, M>& stage,
                                    const StageOptions& options, State& w, Reaction& reaction)
    {
        scratch_of_stage_ = &scratch;
        stage_ = &stage;
        const auto& m = scratch.m;
        m.offset(stage.t, scratch.s);
        const auto& factor = scratch.factor(stage, w);
        scratch.set_rho(factor);
        m.smooth(stage.t, w, scratch.f);
        set_scales(scratch, stage, w, reaction, options.tolerance);
        x_.head(w.size()) = w;
        x_.tail(reaction.size()) = reaction;
        // Below the tolerance, since the scale here is that of the starting point; reactions that
        // depend on one another leave a y that is not exactly zero while they hold it.
        const double tolerance = options.tolerance * (dependent_ ? 1e-3 : 0.25);
        const NewtonReport newton = semismooth_newton(*this, x_,
                                                      {.tolerance = tolerance,
                                                       .max_iterations = options.max_iterations,
                                                       .line_search = options.line_search},
                                                      scratch_);
        w = x_.head(w.size());
        reaction = x_.tail(reaction.size());
        m.smooth(stage.t, w, scratch.f);
        StageReport report = scratch.residual(stage, w, scratch.f, reaction);
        report.iterations = newton.iterations;
        if (!scratch.traits.box) report.residual = newton.residual;
        report.converged = report.residual <= options.tolerance;
        return report;
    }

    void residual(const Vector& x, Vector& f)
    {
        auto& s = *scratch_of_stage_;
        take_apart(x);
        s.m.smooth(stage_->t, w_, s.f_trial);
        (void)s.residual(*stage_, w_, s.f_trial, reaction_);
        f.head(w_.size()) = s.defect.cwiseQuotient(scale_);
        f.tail(reaction_.size()) = (stage_->sigma / law_scale_) * s.image;
    }

    [[nodiscard]] bool direction(const Vector& x, const Vector& f, Vector& d)
    {
        auto& s = *scratch_of_stage_;
        take_apart(x);
        const Eigen::Index n = w_.size();
        const Eigen::Index k = reaction_.size();
        // A box's law has one slope per row.
        s.law_argument(w_, reaction_);
        if (!s.inclusion.derivative(stage_->t, w_, s.argument, slope_.data())) return false;
        auto& jacobian = s.factors[0].jacobian;
        s.m.jacobian(stage_->t, w_, jacobian);
        v_.topLeftCorner(n, n) = stage_->c * s.m.mass() - stage_->kappa * jacobian;
        v_.topRightCorner(n, k) = -stage_->sigma * s.m.act();
        const bool of_reactions = s.traits.of_reactions();
        for (Eigen::Index i = 0; i < k; ++i) {
            for (Eigen::Index j = 0; j < k; ++j) {
                const double unit = i == j ? 1 : 0;
                // Row-major in memory, hence slope_(j, i).
                const double p = slope_(j, i);
                v_(n + i, n + j) = of_reactions ? unit - p : -s.rho[i] * p / s.rho[j];
            }
            v_.row(n + i).head(n).setZero();
            for (Eigen::Index j = 0; j < k; ++j) {
                const double unit = i == j ? 1 : 0;
                const double p = slope_(j, i);
                const double factor = of_reactions ? p * s.rho[j] : s.rho[i] * (p - unit);
                v_.row(n + i).head(n) += factor * s.m.observe().row(j);
            }
            if (s.traits.gives_bound_gradient && s.traits.box) add_bound_gradient(i, s);
            // Changes of reactions that depend on one another are then the least ones.
            if (dependent_) v_(n + i, n + i) += 1e-9;
            v_.row(n + i) *= stage_->sigma;
        }
        s.factors[0].valid = false;
        // Undamped directions at kinks can be singular, which would stall the search.
        unscaled_.head(n) = f.head(n).cwiseProduct(scale_);
        unscaled_.tail(k) = f.tail(k) * law_scale_;
        return dense_direction(v_, lu_, unscaled_, d);
    }

    /// The generalised Jacobian of the last direction, for tests.
    [[nodiscard]] const Matrix& jacobian() const noexcept { return v_; }

private:
    /// Scales of the equation, by rows, and of the law. For a box all of them are the largest term
    /// of the equation. For other sets they are forces, or what the rounding of y leaves of the
    /// tolerance: inertia in a short step exceeds these by far, and beside it no error of a
    /// reaction would show.
    void set_scales(const StageScratch<N, M>& scratch, const Stage<N, M>& stage, const State& w,
                    const Reaction& reaction, double tolerance)
    {
        const auto& m = scratch.m;
        scale_ = (stage.c * times(m.mass(), w)).cwiseAbs().cwiseMax(stage.q.cwiseAbs());
        double force = std::max(stage.kappa * scratch.f.template lpNorm<Eigen::Infinity>(),
                                std::numeric_limits<double>::min());
        if (scratch.traits.box) {
            law_scale_ = std::max(scale_.template lpNorm<Eigen::Infinity>(), force);
            scale_.setConstant(law_scale_);
            return;
        }
        const State of_reactions =
            stage.sigma * times(m.act().cwiseAbs(), Reaction(reaction.cwiseAbs()));
        force = std::max(force, of_reactions.template lpNorm<Eigen::Infinity>());
        scale_ = scale_.cwiseMax(force);
        const Reaction terms = times(m.observe().cwiseAbs(), State(w.cwiseAbs()));
        const double of_y = (scratch.rho.cwiseProduct(terms + scratch.s.cwiseAbs())).maxCoeff();
        const double rounding = 64 * std::numeric_limits<double>::epsilon() * of_y;
        const double lever = m.act().cwiseAbs().maxCoeff();
        law_scale_ = below(std::max(lever > 0 ? force / lever : force, rounding / tolerance));
        scale_ = scale_.unaryExpr(&below).eval();
    }

    /// The power of two next below x, by which numbers are divided without rounding.
    [[nodiscard]] static double below(double x)
    {
        return std::isfinite(x) ? std::ldexp(1, std::ilogb(x)) : x;
    }

    void take_apart(const Vector& x)
    {
        w_ = x.head(w_.size());
        reaction_ = x.tail(reaction_.size());
    }

    void add_bound_gradient(Eigen::Index i, StageScratch<N, M>& s)
    {
        s.inclusion.bounds(stage_->t, w_, s.lower, s.upper);
        const double z = s.argument[i];
        const double side = z > s.upper[i] ? 1 : z < s.lower[i] ? -1 : 0;
        if (side == 0) return;
        s.inclusion.bound_gradient(stage_->t, w_, i, gradient_);
        v_.row(w_.size() + i).head(w_.size()) -= side * gradient_.transpose();
    }

    StageScratch<N, M>* scratch_of_stage_ = nullptr;
    const Stage<N, M>* stage_ = nullptr;
    State scale_;           // of the rows of the equation
    double law_scale_ = 1;  // of the rows of the law
    bool dependent_ = false;
    Vector x_, unscaled_;
    Matrix v_;
    Eigen::PartialPivLU<Matrix> lu_;
    Eigen::Matrix<double, M, M> slope_;
    State w_, gradient_;
    Reaction reaction_;
    NewtonScratch<Vector> scratch_;
};

}  // namespace ricochet::detail
