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

/// f at `scratch.trial`, by its tangent at w where that is exact.
template <int N, int M, class Factor>
void smooth_at_trial(StageScratch<N, M>& scratch, double t, const Factor& factor,
                     const typename AnyMatrices<N, M>::State& w)
{
    if (scratch.traits.affine) {
        scratch.f_trial.noalias() = factor.jacobian * (scratch.trial - w);
        scratch.f_trial += scratch.f;
    } else {
        scratch.m.smooth(t, scratch.trial, scratch.f_trial);
    }
}

/// Solves the inequality with f replaced by its tangent at w: `scratch.reaction` and the state
/// `scratch.trial` that it has. False where no reaction satisfies the law.
template <int N, int M, class Factor>
[[nodiscard]] bool solve_tangent(StageScratch<N, M>& scratch, const Factor& factor,
                                 BranchesOf<M>& branches, bool frozen)
{
    const auto& m = scratch.m;
    auto& inequality = scratch.inequality;
    factor.solve(scratch.base, scratch.w0);
    inequality.w = factor.delassus;
    inequality.y0.noalias() = m.observe() * scratch.w0;
    inequality.y0 -= scratch.s;
    const bool found = frozen ? inequality.solve_on(branches, scratch.reaction, scratch.y)
                              : inequality.solve(scratch.reaction, scratch.y, branches);
    if (!found) return false;
    scratch.trial.noalias() = factor.influence * scratch.reaction;
    scratch.trial += scratch.w0;
    for (Eigen::Index i = 0; i < branches.size(); ++i) {
        if (inequality.held(branches[i])) m.hold(i, scratch.y[i], scratch.s[i], scratch.trial);
    }
    scratch.set_rho(factor);
    return true;
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
    auto& inequality = scratch.inequality;
    scratch.m.offset(stage.t, scratch.s);
    scratch.m.smooth(stage.t, w, scratch.f);
    StageReport best;
    for (int iteration = 1; iteration <= options.max_iterations; ++iteration) {
        const auto& factor = scratch.factor(stage, w);
        if (!scratch.inclusion.bounds(stage.t, w, inequality.lower, inequality.upper)) {
            return {.iterations = iteration, .set = std::max(0, inequality.faulty())};
        }
        scratch.base.noalias() = factor.jacobian * w;
        scratch.base = stage.q + stage.kappa * (scratch.f - scratch.base);
        if (!solve_tangent(scratch, factor, branches, frozen)) {
            return {.iterations = iteration, .set = 0};
        }

        double part = 1;
        for (int halving = 0;; ++halving) {
            if (part < 1) {
                scratch.trial = w + part * (scratch.trial - w);
                scratch.reaction = reaction + part * (scratch.reaction - reaction);
            }
            smooth_at_trial(scratch, stage.t, factor, w);
            StageReport now =
                scratch.residual(stage, scratch.trial, scratch.f_trial, scratch.reaction);
            if (frozen) now = without_law(scratch, stage, branches);
            now.iterations = iteration;
            if (now.residual < best.residual || halving == 6 || iteration == 1) {
                best = now;
                break;
            }
            part = 0.5;
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
