// Internal: what it declares may change without notice.
//
// Which of the reactions allowed at a state does the motion take?
#pragma once

#include "ricochet/detail/composite_step.hpp"

namespace ricochet {

namespace detail {

/// reaction = P(reaction - rho (y / delta + q + W reaction)) by Newton's method.
template <class System>
struct SelectionProblem {
    using Reaction = ReactionOf<System>;
    const SetOf<System>& set;
    const typename InclusionMatrices<System>::Delassus& w;
    const Reaction& constant;
    double rho;

    void residual(const Reaction& r, Reaction& f) const
    {
        const Reaction z = r - rho * (constant + w * r);
        set.project(span_of(z), span_of(f));
        f = r - f;
    }
    [[nodiscard]] bool direction(const Reaction& r, const Reaction& f, Reaction& d) const
    {
        using Matrix = typename InclusionMatrices<System>::Delassus;
        const Reaction z = r - rho * (constant + w * r);
        Matrix slope = w;
        set.derivative(span_of(z), {slope.data(), static_cast<std::size_t>(slope.size())});
        Matrix v = Matrix::Identity(w.rows(), w.cols()) - slope;
        v.noalias() += rho * slope * w;
        Eigen::PartialPivLU<Matrix> lu;
        return dense_direction(v, lu, f, d);
    }
};

/// Whether -y is in the normal cone of the set at r, to a millionth: r = P(r - rho y), with
/// rho y of the size of r. Where no reaction opposes y, inside an obstacle, the r of an
/// approximate problem is finite all the same, and off by its own size.
template <ConvexSet Set, class Reaction>
[[nodiscard]] bool opposes(const Set& set, const Reaction& r, const Reaction& y,
                           const Reaction& rate, double mean)
{
    const double length = y.template lpNorm<Eigen::Infinity>();
    if (length == 0) return true;
    double size = r.template lpNorm<Eigen::Infinity>();
    if (mean > 0) size += rate.template lpNorm<Eigen::Infinity>() / mean;
    if (size == 0) size = 1;
    Reaction z = r - (size / length) * y;
    set.project(span_of(z), span_of(z));
    return (z - r).template lpNorm<Eigen::Infinity>() <= 1e-6 * size;
}

}  // namespace detail

/// The reaction that the motion takes from (t, w): where y is not zero the one point of
/// the set that opposes it most, and where it is zero the reaction with which y
/// leaves or stays, from y' = E A^-1 (f + G reaction) - s'. Where A is the unit matrix
/// and G = E' that is the reaction for which |A w'| is least (and in general for which it
/// is least in the metric of A^-1): the slow solution of the inclusion, whose rate is the
/// right derivative of the motion.
///
/// For a set of states that is no box, or of more than four components, zero.
///
/// @throws std::invalid_argument where the set is empty, where w lies outside a set of
/// states, or where the reaction would have to be infinite (inside an obstacle).
template <Inclusion System>
[[nodiscard]] ReactionOf<System> minimal_selection(const InclusionMatrices<System>& m, double t,
                                                   const StateOf<System>& w)
{
    using Reaction = ReactionOf<System>;
    constexpr bool of_reactions = detail::confines<System>() == Confines::reaction;
    if (!w.allFinite()) detail::refuse_inclusion("the initial state is not finite");
    const auto set = m.system().reaction_set(t, w);
    if (const auto fault = fault_of(set); !fault.empty()) {
        detail::refuse_inclusion(std::string("the set at the start ") + std::string(fault));
    }
    if (static_cast<Eigen::Index>(set.dimension()) != m.reactions()) {
        detail::refuse_inclusion("the set must have the dimension of the reaction, not",
                                 static_cast<double>(set.dimension()));
    }
    StateOf<System> f = w;
    m.smooth(t, w, f);
    if (!f.allFinite()) detail::refuse_inclusion("f is not finite at the start");
    Reaction y, s;
    m.observed(t, w, y);
    m.offset(t, s);
    // y' without the reaction, and what the reaction adds.
    Reaction rate = m.observe() * (m.inverse_mass() * f);
    if constexpr (requires { m.system().offset(t, s); }) {
        const double step = 1e-5 * std::max(1.0, std::abs(t));
        Reaction ahead, behind;
        m.offset(t + step, ahead);
        m.offset(t - step, behind);
        rate -= (ahead - behind) / (2 * step);
    }
    typename InclusionMatrices<System>::Delassus delassus =
        m.observe() * (m.inverse_mass() * m.act());
    const Reaction size = m.observe().cwiseAbs() * w.cwiseAbs() + s.cwiseAbs();

    Reaction reaction;
    reaction.setZero(m.reactions());
    if constexpr (BoxSet<SetOf<System>>) {
        if (m.reactions() <= most_cases || detail::has_dependent_reactions(m)) {
            LinearInequality<reaction_size<System>> inequality;
            inequality.w = delassus;
            inequality.y0 = rate;
            inequality.lower = inequality.upper = reaction;
            for (Eigen::Index i = 0; i < reaction.size(); ++i) {
                const auto k = static_cast<std::size_t>(i);
                double lower = set.lower(k);
                double upper = set.upper(k);
                const double touch = 16 * std::numeric_limits<double>::epsilon() * size[i];
                constexpr double infinity = std::numeric_limits<double>::infinity();
                if constexpr (of_reactions) {
                    if (std::abs(y[i]) > touch) lower = upper = y[i] > 0 ? lower : upper;
                    if (std::isinf(lower) && lower == upper) {
                        detail::refuse_inclusion("the initial state is inside an obstacle: y is",
                                                 y[i]);
                    }
                } else {
                    const double near = touch + 16 * std::numeric_limits<double>::epsilon() *
                                                    std::min(std::abs(lower), std::abs(upper));
                    if (y[i] < lower - near || y[i] > upper + near) {
                        detail::refuse_inclusion("the initial state is outside the set: y is",
                                                 y[i]);
                    }
                    // At a stop the reaction pushes inwards; elsewhere there is none.
                    const bool at_lower = y[i] <= lower + near;
                    const bool at_upper = y[i] >= upper - near;
                    lower = at_upper ? -infinity : 0;
                    upper = at_lower ? infinity : 0;
                }
                inequality.lower[i] = lower;
                inequality.upper[i] = upper;
                // Without influence on y' a reaction that is asked for is all or nothing.
                if (delassus(i, i) == 0) inequality.w(i, i) = inequality.no_influence;
            }
            typename LinearInequality<reaction_size<System>>::Branches branches;
            branches.setConstant(m.reactions(), Branch::inside);
            Reaction unused = reaction;
            if (!inequality.solve(reaction, unused, branches)) {
                detail::refuse_inclusion("no reaction at the start satisfies its law");
            }
            return reaction;
        }
    }
    if constexpr (of_reactions) {
        // A nonzero y outweighs any y'.
        double smallest = std::numeric_limits<double>::infinity();
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            if (std::abs(y[i]) <= 16 * std::numeric_limits<double>::epsilon() * size[i]) y[i] = 0;
            if (y[i] != 0) smallest = std::min(smallest, std::abs(y[i]));
        }
        const double largest =
            std::max(rate.template lpNorm<Eigen::Infinity>(), delassus.cwiseAbs().maxCoeff());
        const double delta = std::isfinite(smallest) && largest > 0 ? 1e-9 * smallest / largest : 1;
        const Reaction constant = y / delta + rate;
        const double mean = delassus.diagonal().cwiseAbs().mean();
        detail::SelectionProblem<System> problem{set, delassus, constant, mean > 0 ? 1 / mean : 1};
        (void)semismooth_newton(problem, reaction, {.tolerance = 1e-13, .max_iterations = 100});
        // Where Newton stalls at a kink the fixed point gets there, at its own pace.
        const double rho = 1 / std::max(delassus.norm(), std::numeric_limits<double>::min());
        for (int i = 0; i < 20000; ++i) {
            Reaction z = reaction - rho * (constant + delassus * reaction);
            set.project(detail::span_of(z), detail::span_of(z));
            const double moved = (z - reaction).template lpNorm<Eigen::Infinity>();
            reaction = z;
            if (moved <= 1e-15 * (1 + reaction.template lpNorm<Eigen::Infinity>())) break;
        }
        if (!reaction.allFinite() || !detail::opposes(set, reaction, y, rate, mean)) {
            detail::refuse_inclusion("the initial state needs an infinite reaction");
        }
    }
    return reaction;
}

}  // namespace ricochet
