// Internal: the declarations of this header may change without notice.
//
// Stages by a projected fixed point with an adapted step.
#pragma once

#include "ricochet/nonsmooth/detail/inclusion_stage.hpp"

namespace ricochet::detail {

/// The iteration of the source, for G = E' with E E' = I:
///
///     z = w - rho F(w),   reaction = P(-(E z - s) / (rho sigma)),
///     w = z + rho sigma G reaction
///
/// where F is the stage's defect without the reaction. After each iteration rho is multiplied by
/// 0.66 where rho |dF| / |dw| > 0.9, and divided by it where that is < 0.3.
/// Unlike in the source it starts from 1 / max |S_ii| in every solve, so that no solve
/// depends on the one before, and its residual does not depend on rho.
///
/// (The Bathe / variational-inequality solver of D. M. Riley and others, Reinforcement
/// Learning-based adaptive time-integration for nonsmooth dynamics, and its code.)
template <int N, int M>
[[nodiscard]] StageReport solve_fixed_point(StageScratch<N, M>& scratch, const Stage<N, M>& stage,
                                            const StageOptions& options,
                                            typename AnyMatrices<N, M>::State& w,
                                            typename AnyMatrices<N, M>::Reaction& reaction)
{
    const auto& m = scratch.m;
    m.offset(stage.t, scratch.s);
    const auto& factor = scratch.factor(stage, w);
    scratch.set_rho(factor);
    double largest = 0;
    for (Eigen::Index i = 0; i < m.own_size(); ++i) {
        largest = std::max(
            largest, std::abs(stage.c * m.mass()(i, i) - stage.kappa * factor.jacobian(i, i)));
    }
    double rho = largest > 0 ? 1 / largest : 1;
    auto& force = scratch.f_trial;  // F
    auto& before = scratch.w0;
    const auto defect = [&](const auto& at, auto& out) {
        m.smooth(stage.t, at, scratch.f);
        out.noalias() = stage.c * times(m.mass(), at);
        out -= stage.kappa * scratch.f + stage.q;
    };
    defect(w, force);
    StageReport report;
    const int limit = 100 * options.max_iterations;
    for (int iteration = 1; iteration <= limit; ++iteration) {
        before = w;
        scratch.trial = force;
        w -= rho * force;
        scratch.argument.noalias() = times(m.observe(), w);
        scratch.argument -= scratch.s;
        const bool of_reactions = scratch.traits.of_reactions();
        if (of_reactions) scratch.argument /= -rho * stage.sigma;
        if (!scratch.inclusion.project(stage.t, before, scratch.argument, scratch.image)) {
            return {.iterations = iteration, .set = 0};
        }
        if (of_reactions) {
            reaction = scratch.image;
        } else {
            reaction = (scratch.image - scratch.argument) / (rho * stage.sigma);
        }
        w.noalias() += (rho * stage.sigma) * times(m.act(), reaction);
        defect(w, force);
        report = scratch.residual(stage, w, scratch.f, reaction);
        report.iterations = iteration;
        report.converged = report.residual <= options.tolerance;
        if (report.converged || !std::isfinite(report.residual)) return report;
        const double moved = norm(w - before);
        if (moved > 1e-14 + 1e-12 * (1 + norm(w))) {
            const double ratio = rho * norm(force - scratch.trial) / moved;
            if (ratio > 0.9) rho *= 0.66;
            if (ratio < 0.3) rho /= 0.66;
        }
    }
    return report;
}

}  // namespace ricochet::detail
