// Internal: the declarations of this header may change without notice.
//
// Measures how well a state and its reaction satisfy the law of an inclusion.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "ricochet/nonsmooth/detail/any_inclusion.hpp"

namespace ricochet {

/// The largest violation of "reaction in K and -y in the normal cone of K at the reaction" at
/// (t, w), as a fraction of the forces: 0 where the law holds, about 1 where a reaction acts at the
/// wrong bound, infinite where a set is empty. A y is zero below 1e-9 of its terms and of what the
/// forces, and reactions at the nearer of their bounds or against y, change it by in `span` [s].
/// Boxes are measured by component; 0 for a set of states, where the solver has its own residual.
// Long: one measure for boxes and other sets, whose steps have all of its vectors in common.
template <int N, int M>
[[nodiscard]] double law_violation(
    const detail::AnyMatrices<N, M>& m, double t,
    const std::type_identity_t<Eigen::Matrix<double, N, 1>>& w,
    const std::type_identity_t<Eigen::Matrix<double, M, 1>>& reaction, double span)
{
    using Reaction = Eigen::Matrix<double, M, 1>;
    if (!m.traits().of_reactions()) return 0;
    const auto& inclusion = m.inclusion();
    Reaction y, size;
    m.observed(t, w, y);
    m.offset(t, size);
    Eigen::Matrix<double, N, 1> f = w;
    m.smooth(t, w, f);
    const double lever = m.act().cwiseAbs().maxCoeff();
    const double force = lever > 0 ? f.template lpNorm<Eigen::Infinity>() / lever : 0;
    const double scale = std::max(
        {reaction.template lpNorm<Eigen::Infinity>(), force, std::numeric_limits<double>::min()});
    Reaction lower = y, upper = y, most = reaction.cwiseAbs();
    if (m.traits().box) {
        if (!inclusion.bounds(t, w, lower, upper)) return std::numeric_limits<double>::infinity();
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            const double nearer = std::min(std::abs(lower[i]), std::abs(upper[i]));
            if (std::isfinite(nearer)) most[i] = std::max(most[i], nearer);
        }
    }
    // The reaction of a set that is no box at a y, however small.
    const auto against = [&](Reaction& z) {
        const double length = y.template lpNorm<Eigen::Infinity>();
        z = reaction;
        if (length > 0) z -= scale * (y / length);  // y may be denormal
        return inclusion.project(t, w, z, z);
    };
    Reaction z = reaction;
    if (!m.traits().box) {
        if (!against(z)) return std::numeric_limits<double>::infinity();
        most = most.cwiseMax(z.cwiseAbs()).eval();
        // Without forces only the set tells how large they may be, if it is bounded.
        constexpr double far = 1e150;
        const double length = y.template lpNorm<Eigen::Infinity>();
        if (length > 0) z -= far * (y / length);
        if (length > 0 && inclusion.project(t, w, z, z) &&
            z.template lpNorm<Eigen::Infinity>() < 1e-3 * far) {
            most = most.cwiseMax(z.cwiseAbs()).eval();
        }
    }
    f = f.cwiseAbs().eval() + detail::times(m.act().cwiseAbs(), most);
    f = w.cwiseAbs() + span * detail::times(m.inverse_mass().cwiseAbs(), f).eval();
    size = 1e-9 * (detail::times(m.observe().cwiseAbs(), f) + size.cwiseAbs());
    double worst = 0;
    if (m.traits().box) {
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            const double r = reaction[i];
            const double nearest = y[i] > size[i]    ? lower[i]
                                   : y[i] < -size[i] ? upper[i]
                                                     : std::clamp(r, lower[i], upper[i]);
            if (r == nearest) continue;
            const double unit = std::max(scale, std::abs(nearest));
            worst = std::max(worst, std::isinf(nearest) ? 1 : std::abs(r - nearest) / unit);
        }
    } else {
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            if (std::abs(y[i]) <= size[i]) y[i] = 0;
        }
        if (!against(z)) return std::numeric_limits<double>::infinity();
        worst = (z - reaction).template lpNorm<Eigen::Infinity>() / scale;
    }
    return std::isfinite(worst) ? worst : std::numeric_limits<double>::infinity();
}

}  // namespace ricochet
