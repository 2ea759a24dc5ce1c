// Internal: the declarations of this header may change without notice.
//
// Stages whose reactions lie in a box: the smooth part is solved by Newton's method, the
// inequality of every iterate exactly, by cases.
#pragma once

#include <concepts>

#include "ricochet/detail/inclusion_stage.hpp"

namespace ricochet::detail {

template <int M>
using BranchesOf = typename LinearInequality<M>::Branches;

/// The residual on frozen branches: the equation, and the bounds where they were taken
/// from an earlier iterate.
template <int N, int M>
[[nodiscard]] StageReport without_law(StageScratch<N, M>& scratch, const Stage<N, M>& stage,
                                      const BranchesOf<M>& branches)
{
    const double scale =
        std::max({(stage.c * (scratch.m.mass() * scratch.trial)).template lpNorm<Eigen::Infinity>(),
                  stage.q.template lpNorm<Eigen::Infinity>(),
                  stage.kappa * scratch.f_trial.template lpNorm<Eigen::Infinity>()});
    double worst = scratch.defect.template lpNorm<Eigen::Infinity>();
    if (scratch.traits.of_reactions()) {
        scratch.inclusion.bounds(stage.t, scratch.trial, scratch.lower, scratch.upper);
        for (Eigen::Index i = 0; i < branches.size(); ++i) {
            const double bound = branches[i] == Branch::lower   ? scratch.lower[i]
                                 : branches[i] == Branch::upper ? scratch.upper[i]
                                                                : scratch.reaction[i];
            worst = std::max(worst, stage.sigma * std::abs(scratch.reaction[i] - bound) *
                                        scratch.m.act().col(i).template lpNorm<Eigen::Infinity>());
        }
    }
    return {.residual = scale > 0 ? worst / scale : worst};
}

/// Newton on f with the inequality solved exactly (Josephy, Newton's method for
/// generalized equations, 1979); an affine f with a constant set takes one iteration.
///
/// Starts from (w, reaction) and overwrites them; on failure they are the last iterate.
/// `frozen`: stays on these branches, whether the solution lies on them or not.
template <int N, int M>
[[nodiscard]] StageReport solve_cases(StageScratch<N, M>& scratch, const Stage<N, M>& stage,
                                      const StageOptions& options,
                                      typename AnyMatrices<N, M>::State& w,
                                      typename AnyMatrices<N, M>::Reaction& reaction,
                                      BranchesOf<M>& branches, bool frozen = false)
{
    const auto& m = scratch.m;
    auto& inequality = scratch.inequality;
    m.offset(stage.t, scratch.s);
    m.smooth(stage.t, w, scratch.f);
    StageReport best;
    for (int iteration = 1; iteration <= options.max_iterations; ++iteration) {
        const auto& factor = scratch.factor(stage, w);
        if (!scratch.inclusion.bounds(stage.t, w, inequality.lower, inequality.upper)) {
            return {.iterations = iteration, .set = std::max(0, inequality.faulty())};
        }
        // w as a function of the reaction, f replaced by its tangent.
        scratch.base.noalias() = factor.jacobian * w;
        scratch.base = stage.q + stage.kappa * (scratch.f - scratch.base);
        factor.solve(scratch.base, scratch.w0);
        inequality.w = factor.delassus;
        inequality.y0.noalias() = m.observe() * scratch.w0;
        inequality.y0 -= scratch.s;
        const bool found = frozen ? inequality.solve_on(branches, scratch.reaction, scratch.y)
                                  : inequality.solve(scratch.reaction, scratch.y, branches);
        if (!found) return {.iterations = iteration, .set = 0};
        scratch.trial.noalias() = factor.influence * scratch.reaction;
        scratch.trial += scratch.w0;
        for (Eigen::Index i = 0; i < reaction.size(); ++i) {
            if (inequality.held(branches[i])) {
                m.hold(i, scratch.y[i], scratch.s[i], scratch.trial);
            }
        }

        scratch.set_rho(factor);
        double share = 1;
        for (int halving = 0;; ++halving) {
            if (share < 1) {
                scratch.trial = w + share * (scratch.trial - w);
                scratch.reaction = reaction + share * (scratch.reaction - reaction);
            }
            if (scratch.traits.affine) {
                scratch.f_trial.noalias() = factor.jacobian * (scratch.trial - w);
                scratch.f_trial += scratch.f;
            } else {
                m.smooth(stage.t, scratch.trial, scratch.f_trial);
            }
            StageReport now =
                scratch.residual(stage, scratch.trial, scratch.f_trial, scratch.reaction);
            if (frozen) now = without_law(scratch, stage, branches);
            now.iterations = iteration;
            if (now.residual < best.residual || halving == 6 || iteration == 1) {
                best = now;
                break;
            }
            share = 0.5;
        }
        w = scratch.trial;
        reaction = scratch.reaction;
        scratch.f = scratch.f_trial;
        if (best.residual <= options.tolerance) {
            best.converged = true;
            return best;
        }
        if (!w.allFinite()) return best;
    }
    return best;
}

}  // namespace ricochet::detail
