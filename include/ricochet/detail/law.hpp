// Internal: what it declares may change without notice.
//
// Whether a state and its reaction satisfy the law of an inclusion.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "ricochet/nonsmooth/inclusion.hpp"

namespace ricochet {

/// The largest violation of "reaction in K and -y in the normal cone of K at the reaction" at
/// (t, w), as a fraction of the forces: 0 where the law holds, and of the order of 1 where a
/// reaction acts at the wrong bound. A y counts as zero below 1e-9 of its terms and of what the
/// forces make of it in `span` [s], such as a step. For boxes each component by itself;
/// infinite where a set is empty. For a set of states 0, since the law is then the solver's
/// residual.
template <Inclusion System>
[[nodiscard]] double law_violation(const InclusionMatrices<System>& m, double t,
                                   const StateOf<System>& w, const ReactionOf<System>& reaction,
                                   double span)
{
    if constexpr (detail::confines<System>() == Confines::state) {
        return 0;
    } else {
        const auto set = m.system().reaction_set(t, w);
        if (!fault_of(set).empty()) return std::numeric_limits<double>::infinity();
        ReactionOf<System> y, size;
        m.observed(t, w, y);
        m.offset(t, size);
        StateOf<System> f = w;
        m.smooth(t, w, f);
        const double lever = m.act().cwiseAbs().maxCoeff();
        const double force = lever > 0 ? f.template lpNorm<Eigen::Infinity>() / lever : 0;
        const double scale = std::max({reaction.template lpNorm<Eigen::Infinity>(), force,
                                       std::numeric_limits<double>::min()});
        f = f.cwiseAbs().eval() + m.act().cwiseAbs() * reaction.cwiseAbs();
        f = w.cwiseAbs() + span * (m.inverse_mass().cwiseAbs() * f).eval();
        size = 1e-9 * (m.observe().cwiseAbs() * f + size.cwiseAbs());
        double worst = 0;
        if constexpr (BoxSet<SetOf<System>>) {
            for (Eigen::Index i = 0; i < y.size(); ++i) {
                const double lower = set.lower(static_cast<std::size_t>(i));
                const double upper = set.upper(static_cast<std::size_t>(i));
                const double r = reaction[i];
                const double nearest = y[i] > size[i]    ? lower
                                       : y[i] < -size[i] ? upper
                                                         : std::clamp(r, lower, upper);
                if (r == nearest) continue;
                const double most = std::max(scale, std::abs(nearest));
                worst = std::max(worst, std::isinf(nearest) ? 1 : std::abs(r - nearest) / most);
            }
        } else {
            for (Eigen::Index i = 0; i < y.size(); ++i) {
                if (std::abs(y[i]) <= size[i]) y[i] = 0;
            }
            const double length = y.template lpNorm<Eigen::Infinity>();
            ReactionOf<System> z = reaction;
            if (length > 0) z -= scale / length * y;
            set.project(detail::span_of(z), detail::span_of(z));
            worst = (z - reaction).template lpNorm<Eigen::Infinity>() / scale;
        }
        return std::isfinite(worst) ? worst : std::numeric_limits<double>::infinity();
    }
}

}  // namespace ricochet
