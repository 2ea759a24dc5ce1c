// Internal: the declarations of this header may change without notice.
//
// The reaction that the motion selects among those allowed at a state.
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <type_traits>

#include "ricochet/nonsmooth/composite_step.hpp"

namespace ricochet {

namespace detail {

/// @throws std::invalid_argument for a time or state that is not finite, and for another size.
template <int N, int M>
void check_start(const AnyMatrices<N, M>& m, double t, const typename AnyMatrices<N, M>::State& w)
{
    if (!std::isfinite(t)) refuse_inclusion("the time at the start must be finite, not", t);
    if (w.size() != m.size()) {
        refuse_inclusion("the initial state must have as many components as the system, not",
                         static_cast<double>(w.size()));
    }
    if (!w.allFinite()) refuse_inclusion("the initial state is not finite");
}

/// @throws std::invalid_argument for a reaction outside its set.
template <int N, int M>
void check_reaction(const AnyMatrices<N, M>& m, const StateWithReaction<N, M>& start)
{
    if (start.reaction.size() != m.reactions()) {
        refuse_inclusion("the start must have as many reactions as the system, not",
                         static_cast<double>(start.reaction.size()));
    }
    if (!start.reaction.allFinite()) refuse_inclusion("the reaction at the start is not finite");
    if (!m.traits().of_reactions()) return;
    typename AnyMatrices<N, M>::Reaction nearest = start.reaction;
    m.inclusion().project(start.t, start.w, start.reaction, nearest);
    const double off = (nearest - start.reaction).template lpNorm<Eigen::Infinity>();
    // The reaction of an earlier step lies in the set only to the solver's tolerance.
    if (!(off <= 1e-9 * (1 + nearest.template lpNorm<Eigen::Infinity>()))) {
        refuse_inclusion("the reaction at the start is outside its set by", off);
    }
}

/// reaction = P(reaction - rho (y / delta + q + W reaction)) by Newton's method.
template <int N, int M>
struct RICOCHET_ALIGNED SelectionProblem {
    using Reaction = typename AnyMatrices<N, M>::Reaction;
    using Matrix = typename AnyMatrices<N, M>::Delassus;
    const AnyInclusion<N, M>& inclusion;
    double t;
    const typename AnyMatrices<N, M>::State& state;
    const Matrix& w;
    const Reaction& constant;
    double rho;

    void residual(const Reaction& r, Reaction& f) const
    {
        const Reaction z = r - rho * (constant + times(w, r));
        inclusion.project(t, state, z, f);
        f = r - f;
    }
    [[nodiscard]] bool direction(const Reaction& r, const Reaction& f, Reaction& d) const
    {
        const Reaction z = r - rho * (constant + times(w, r));
        Matrix slope = w;
        inclusion.derivative(t, state, z, slope.data());
        Matrix v = Matrix::Identity(w.rows(), w.cols()) - slope;
        v.noalias() += times(Matrix(rho * slope), w);
        Eigen::PartialPivLU<Matrix> lu;
        return dense_direction(v, lu, f, d);
    }
};

/// What decides the reaction with which a motion starts from (t, w).
template <int N, int M>
struct RICOCHET_ALIGNED SelectionStart {
    using Matrices = AnyMatrices<N, M>;
    using State = typename Matrices::State;
    using Reaction = typename Matrices::Reaction;

    const Matrices& m;
    double t;
    const State& w;
    Reaction y;                            ///< E w - s(t)
    Reaction rate;                         ///< y' without the reaction
    Reaction size;                         ///< of the terms of y, which bounds its rounding
    typename Matrices::Delassus delassus;  ///< what a reaction adds to y': E A^-1 G

    /// @throws std::invalid_argument where the set, the state or f is not what it has to be.
    SelectionStart(const Matrices& matrices, double time, const State& state)
        : m(matrices), t(time), w(state)
    {
        const auto& inclusion = m.inclusion();
        check_start(m, t, w);
        if (const std::string fault = inclusion.fault(t, w); !fault.empty()) {
            refuse_inclusion("the set at the start " + fault);
        }
        if (const std::size_t dimension = inclusion.set_dimension(t, w);
            static_cast<Eigen::Index>(dimension) != m.own_reactions()) {
            refuse_inclusion("the set must have the dimension of the reaction, not",
                             static_cast<double>(dimension));
        }
        State f = w;
        m.smooth(t, w, f);
        if (!f.allFinite()) refuse_inclusion("f is not finite at the start");
        Reaction s;
        m.observed(t, w, y);
        m.offset(t, s);
        rate = times(m.observe(), times(m.inverse_mass(), f));
        m.subtract_offset_rate(t, rate);
        delassus = times(m.observe(), times(m.inverse_mass(), m.act()));
        size = times(m.observe().cwiseAbs(), w.cwiseAbs()) + s.cwiseAbs();
    }

    [[nodiscard]] double rounding(Eigen::Index i) const
    {
        return 16 * std::numeric_limits<double>::epsilon() * size[i];
    }

    /// Narrows the bounds of reaction i to those that y allows: a nonzero y has its reaction at a
    /// bound; at a stop of a set of states the reaction pushes inwards, elsewhere there is none.
    void narrow(Eigen::Index i, double& lower, double& upper) const
    {
        constexpr double infinity = std::numeric_limits<double>::infinity();
        const double touch = rounding(i);
        if (m.traits().of_reactions()) {
            if (std::abs(y[i]) > touch) lower = upper = y[i] > 0 ? lower : upper;
            if (std::isinf(lower) && lower == upper) {
                refuse_inclusion("the initial state is inside an obstacle: y is", y[i]);
            }
            return;
        }
        const double near = touch + 16 * std::numeric_limits<double>::epsilon() *
                                        std::min(std::abs(lower), std::abs(upper));
        if (y[i] < lower - near || y[i] > upper + near) {
            refuse_inclusion("the initial state is outside the set: y is", y[i]);
        }
        const bool at_lower = y[i] <= lower + near;
        const bool at_upper = y[i] >= upper - near;
        lower = at_upper ? -infinity : 0;
        upper = at_lower ? infinity : 0;
    }

    /// The reaction where the set is a box, by its cases.
    [[nodiscard]] Reaction in_box() const
    {
        Reaction reaction;
        reaction.setZero(m.reactions());
        LinearInequality<M> inequality;
        if constexpr (M != Eigen::Dynamic) inequality.unknowns = m.own_reactions();
        inequality.w = delassus;
        inequality.y0 = rate;
        inequality.lower = inequality.upper = reaction;
        m.inclusion().bounds(t, w, inequality.lower, inequality.upper);
        for (Eigen::Index i = 0; i < reaction.size(); ++i) {
            narrow(i, inequality.lower[i], inequality.upper[i]);
            // A required reaction without influence on y' is at one bound or the other.
            if (delassus(i, i) == 0) inequality.w(i, i) = inequality.no_influence;
        }
        typename LinearInequality<M>::Branches branches;
        branches.setConstant(m.reactions(), Branch::inside);
        Reaction unused = reaction;
        if (!inequality.solve(reaction, unused, branches)) {
            refuse_inclusion("no reaction at the start satisfies its law");
        }
        return reaction;
    }

    /// The reaction in any convex set: a nonzero y outweighs any y'. A y counts as zero below the
    /// rounding of its terms and of the change that the forces cause in `span` [s].
    [[nodiscard]] Reaction in_set(double span)
    {
        Reaction reaction;
        reaction.setZero(m.reactions());
        double smallest = std::numeric_limits<double>::infinity();
        size += span * rate.cwiseAbs();
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            if (std::abs(y[i]) <= rounding(i)) y[i] = 0;
            if (y[i] != 0) smallest = std::min(smallest, std::abs(y[i]));
        }
        const double largest =
            std::max(rate.template lpNorm<Eigen::Infinity>(), delassus.cwiseAbs().maxCoeff());
        const double delta = std::isfinite(smallest) && largest > 0 ? 1e-9 * smallest / largest : 1;
        const Reaction constant = y / delta + rate;
        double mean = 0;
        for (Eigen::Index i = 0; i < y.size(); ++i) mean += std::abs(delassus(i, i));
        mean /= static_cast<double>(m.own_reactions());
        SelectionProblem<N, M> problem{m.inclusion(), t,        w,
                                       delassus,      constant, mean > 0 ? 1 / mean : 1};
        (void)semismooth_newton(problem, reaction, {.tolerance = 1e-13, .max_iterations = 100});
        // Where Newton's method stalls at a kink the fixed point converges, more slowly.
        const double rho = 1 / std::max(norm(delassus), std::numeric_limits<double>::min());
        for (int i = 0; i < 20000; ++i) {
            Reaction z = reaction - rho * (constant + times(delassus, reaction));
            m.inclusion().project(t, w, z, z);
            const double moved = (z - reaction).template lpNorm<Eigen::Infinity>();
            reaction = z;
            if (moved <= 1e-15 * (1 + reaction.template lpNorm<Eigen::Infinity>())) break;
        }
        if (!reaction.allFinite() || !opposes(reaction, mean)) {
            refuse_inclusion("the initial state needs an infinite reaction");
        }
        return reaction;
    }

    /// Whether -y is in the normal cone of the set at r, to 1e-6: r = P(r - rho y), with
    /// rho y of the size of r. Inside an obstacle, where no reaction has -y in its normal cone,
    /// the r of an approximate problem is finite nevertheless, and wrong by its own size.
    [[nodiscard]] bool opposes(const Reaction& r, double mean) const
    {
        const double length = y.template lpNorm<Eigen::Infinity>();
        if (length == 0) return true;
        double scale = r.template lpNorm<Eigen::Infinity>();
        if (mean > 0) scale += rate.template lpNorm<Eigen::Infinity>() / mean;
        if (scale == 0) scale = 1;
        Reaction z = r - (scale / length) * y;
        m.inclusion().project(t, w, z, z);
        return (z - r).template lpNorm<Eigen::Infinity>() <= 1e-6 * scale;
    }
};

}  // namespace detail

/// The reaction that the motion takes from (t, w): where y is not zero, the one point of
/// the set at which -y is in the normal cone; where y is zero, the reaction with which y
/// leaves or stays, from y' = E A^-1 (f + G reaction) - s'. Where A is the unit matrix
/// and G = E' that is the reaction for which |A w'| is least (and in general for which it
/// is least in the metric of A^-1): the slow solution of the inclusion, whose rate is the
/// right derivative of the motion.
///
/// For a set of states that is no box, or of more than four components, zero.
///
/// @param span  [s] as in `SelectionStart::in_set`, for sets that are no boxes
/// @throws std::invalid_argument where the set is empty, where w lies outside a set of
/// states, or where the reaction would have to be infinite (inside an obstacle).
template <int N, int M>
[[nodiscard]] Eigen::Matrix<double, M, 1> minimal_selection(
    const detail::AnyMatrices<N, M>& m, double t,
    const std::type_identity_t<Eigen::Matrix<double, N, 1>>& w, double span)
{
    detail::SelectionStart<N, M> start(m, t, w);
    if (m.traits().box && (m.reactions() <= most_cases || detail::has_dependent_reactions(m))) {
        return start.in_box();
    }
    if (m.traits().of_reactions()) return start.in_set(span);
    return detail::SelectionStart<N, M>::Reaction::Zero(m.reactions());
}

}  // namespace ricochet
