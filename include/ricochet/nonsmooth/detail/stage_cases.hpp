// Internal: the declarations of this header may change without notice.
//
// Stages whose reactions lie in a box: the smooth part is solved by Newton's method, the
// inequality of every iterate exactly, by cases.
#pragma once

#include <concepts>

#include "ricochet/nonsmooth/detail/inclusion_stage.hpp"

namespace ricochet::detail {

template <int M>
using BranchesOf = typename LinearInequality<M>::Branches;

/// Newton on f with the inequality solved exactly (Josephy, Newton's method for
/// generalized equations, 1979); an affine f with a constant set takes one iteration.
template <int N, int M>
class StageCases {
    using State = typename AnyMatrices<N, M>::State;
    using Reaction = typename AnyMatrices<N, M>::Reaction;
    using Factor = StageFactor<N, M>;

public:
    /// Keeps references to all of them. `branches` are those to start from, and become those of
    /// the solution. `frozen`: stays on them, whether the solution lies on them or not.
    StageCases(StageScratch<N, M>& scratch, const Stage<N, M>& stage, BranchesOf<M>& branches,
               bool frozen = false)
        : scratch_(scratch), stage_(stage), branches_(branches), frozen_(frozen)
    {
    }

    /// Starts from (w, reaction) and overwrites them; on failure they are the last iterate.
    [[nodiscard]] StageReport solve(const StageOptions& options, State& w, Reaction& reaction)
    {
        auto& inequality = scratch_.inequality;
        inequality.near = reaction;
        scratch_.m.offset(stage_.t, scratch_.s);
        scratch_.m.smooth(stage_.t, w, scratch_.f);
        StageReport best;
        for (int iteration = 1; iteration <= options.max_iterations; ++iteration) {
            const Factor& factor = scratch_.factor(stage_, w);
            if (!scratch_.inclusion.bounds(stage_.t, w, inequality.lower, inequality.upper)) {
                return {.iterations = iteration, .set = std::max(0, inequality.faulty())};
            }
            scratch_.base.noalias() = times(factor.jacobian, w);
            scratch_.base = stage_.q + stage_.kappa * (scratch_.f - scratch_.base);
            if (!solve_tangent(factor)) return {.iterations = iteration, .set = 0};

            double part = 1;
            for (int halving = 0;; ++halving) {
                if (part < 1) {
                    scratch_.trial = w + part * (scratch_.trial - w);
                    scratch_.reaction = reaction + part * (scratch_.reaction - reaction);
                }
                smooth_at_trial(factor, w);
                StageReport now =
                    scratch_.residual(stage_, scratch_.trial, scratch_.f_trial, scratch_.reaction);
                if (frozen_) now = without_law();
                now.iterations = iteration;
                if (now.residual < best.residual || halving == 6 || iteration == 1) {
                    best = now;
                    break;
                }
                part = 0.5;
            }
            w = scratch_.trial;
            reaction = scratch_.reaction;
            scratch_.f = scratch_.f_trial;
            if (best.residual <= options.tolerance) {
                best.converged = true;
                return best;
            }
            if (!w.allFinite()) return best;
        }
        return best;
    }

private:
    /// The residual on frozen branches: the equation, and the bounds where they were taken
    /// from an earlier iterate.
    [[nodiscard]] StageReport without_law()
    {
        const double scale =
            std::max({(stage_.c * times(scratch_.m.mass(), scratch_.trial))
                          .template lpNorm<Eigen::Infinity>(),
                      stage_.q.template lpNorm<Eigen::Infinity>(),
                      stage_.kappa * scratch_.f_trial.template lpNorm<Eigen::Infinity>()});
        double worst = scratch_.defect.template lpNorm<Eigen::Infinity>();
        if (scratch_.traits.of_reactions()) {
            scratch_.inclusion.bounds(stage_.t, scratch_.trial, scratch_.lower, scratch_.upper);
            for (Eigen::Index i = 0; i < branches_.size(); ++i) {
                const double bound = branches_[i] == Branch::lower   ? scratch_.lower[i]
                                     : branches_[i] == Branch::upper ? scratch_.upper[i]
                                                                     : scratch_.reaction[i];
                worst =
                    std::max(worst, stage_.sigma * std::abs(scratch_.reaction[i] - bound) *
                                        scratch_.m.act().col(i).template lpNorm<Eigen::Infinity>());
            }
        }
        return {.residual = scale > 0 ? worst / scale : worst};
    }

    /// f at `scratch.trial`, by its tangent at w where that is exact.
    void smooth_at_trial(const Factor& factor, const State& w)
    {
        if (scratch_.traits.affine) {
            scratch_.f_trial.noalias() = times(factor.jacobian, State(scratch_.trial - w));
            scratch_.f_trial += scratch_.f;
        } else {
            scratch_.m.smooth(stage_.t, scratch_.trial, scratch_.f_trial);
        }
    }

    /// Solves the inequality with f replaced by its tangent at w: `scratch.reaction` and the state
    /// `scratch.trial` that it has. False where no reaction satisfies the law.
    [[nodiscard]] bool solve_tangent(const Factor& factor)
    {
        const auto& m = scratch_.m;
        auto& inequality = scratch_.inequality;
        factor.solve(scratch_.base, scratch_.w0);
        inequality.w = factor.delassus;
        inequality.y0.noalias() = times(m.observe(), scratch_.w0);
        inequality.y0 -= scratch_.s;
        const bool found = frozen_ ? inequality.solve_on(branches_, scratch_.reaction, scratch_.y)
                                   : inequality.solve(scratch_.reaction, scratch_.y, branches_);
        if (!found) return false;
        scratch_.trial.noalias() = times(factor.influence, scratch_.reaction);
        scratch_.trial += scratch_.w0;
        for (Eigen::Index i = 0; i < branches_.size(); ++i) {
            if (inequality.held(branches_[i])) {
                m.hold(i, scratch_.y[i], scratch_.s[i], scratch_.trial);
            }
        }
        scratch_.set_rho(factor);
        return true;
    }

    StageScratch<N, M>& scratch_;
    const Stage<N, M>& stage_;
    BranchesOf<M>& branches_;
    bool frozen_;
};

}  // namespace ricochet::detail
