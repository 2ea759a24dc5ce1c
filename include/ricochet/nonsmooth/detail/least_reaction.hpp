// Internal: the declarations of this header may change without notice.
//
// Among the reactions of a box that have the same effect, the least.
//
// Where G is not of full column rank, as for two contacts on one block, the motion determines G r
// and not r. The least r, in the Euclidean norm, within the bounds is unique, and no choice of a
// solver.
#pragma once

#include <Eigen/Core>

#include <cmath>

#include "ricochet/nonsmooth/detail/alignment.hpp"

namespace ricochet::detail {

template <int M>
class RICOCHET_ALIGNED LeastReaction {
public:
    using Reaction = Eigen::Matrix<double, M, 1>;
    using Square = Eigen::Matrix<double, M, M>;

    /// Every reaction has an effect of its own.
    LeastReaction() = default;
    /// Takes the rows of G and the number of reactions.
    template <class Action>
    LeastReaction(const Action& act, Eigen::Index reactions)
    {
        without_effect_.setZero(act.cols(), act.cols());
        without_effect_.diagonal().head(reactions).setOnes();
        const double size = act.cwiseAbs().maxCoeff();
        for (Eigen::Index k = 0; k < act.rows(); ++k) {
            const Reaction row = act.row(k).transpose();
            remove(without_effect_ * row, 1e-12 * size, without_effect_);
        }
        depend_ = without_effect_.norm() > 0.5;
    }

    /// Whether some reactions depend on one another.
    [[nodiscard]] bool depend() const noexcept { return depend_; }

    /// Replaces r, within its bounds, by the least with the same effect, by an active set method
    /// (J. Nocedal and S. J. Wright, Numerical Optimization, 2006, algorithm 16.3). Equal bounds
    /// keep a reaction where it is.
    void choose(const Reaction& lower, const Reaction& upper, Reaction& r) const
    {
        const double size = r.template lpNorm<Eigen::Infinity>();
        Reaction side = Reaction::Zero(r.size());  // of the bound that holds it: -1, 1; 0: none
        for (Eigen::Index i = 0; i < r.size(); ++i) side[i] = lower[i] == upper[i] ? 1 : 0;
        for (Eigen::Index round = 0; round < 8 * r.size(); ++round) {
            const Reaction way = -(free_of_effect(side) * r);
            const Eigen::Index blocked = go(way, size, side, lower, upper, r);
            if (blocked >= 0) {
                side[blocked] = way[blocked] > 0 ? 1 : -1;
                continue;
            }
            const Eigen::Index released = find_released(size, side, lower, upper, r);
            if (released < 0) return;
            side[released] = 0;
        }
    }

private:
    /// Removes the direction v from what a projection keeps, unless it is rounding.
    static void remove(const Reaction& v, double rounding, Square& projection)
    {
        if (v.norm() > rounding) projection -= v * v.transpose() / v.squaredNorm();
    }

    /// Projection onto the changes without effect that leave the reactions at bounds alone.
    [[nodiscard]] Square free_of_effect(const Reaction& side) const
    {
        Square out = without_effect_;
        for (Eigen::Index i = 0; i < side.size(); ++i) {
            if (side[i] != 0) remove(out.col(i), 1e-10, out);
        }
        return out;
    }

    /// Goes the way up to the first bound, whose reaction is returned, or -1.
    [[nodiscard]] static Eigen::Index go(const Reaction& way, double size, const Reaction& side,
                                         const Reaction& lower, const Reaction& upper, Reaction& r)
    {
        Eigen::Index first = -1;
        double length = 1;
        for (Eigen::Index i = 0; i < r.size(); ++i) {
            if (side[i] != 0 || std::abs(way[i]) <= negligible * size) continue;
            const double room = ((way[i] > 0 ? upper[i] : lower[i]) - r[i]) / way[i];
            if (room >= length) continue;
            length = room > 0 ? room : 0;
            first = i;
        }
        for (Eigen::Index i = 0; i < r.size(); ++i) {
            if (side[i] == 0) r[i] += length * way[i];
        }
        if (first >= 0) r[first] = way[first] > 0 ? upper[first] : lower[first];
        return first;
    }

    /// The first reaction at a bound that would leave it inwards, or -1.
    [[nodiscard]] Eigen::Index find_released(double size, Reaction side, const Reaction& lower,
                                             const Reaction& upper, const Reaction& r) const
    {
        for (Eigen::Index i = 0; i < r.size(); ++i) {
            const double bound = side[i];
            if (bound == 0 || lower[i] == upper[i]) continue;
            side[i] = 0;
            const double way = -free_of_effect(side).row(i).dot(r);
            side[i] = bound;
            if (bound * way < -100 * negligible * size) return i;
        }
        return -1;
    }

    /// Rounding of sums of the terms of a reaction, in parts of the largest.
    static constexpr double negligible = 1e-14;

    Square without_effect_;  ///< projection onto G r = 0
    bool depend_ = false;
};

/// The least of all reactions of a state with the same effect that satisfy its law.
template <int M>
class RICOCHET_ALIGNED LeastOfState {
public:
    /// Replaces the reaction of a state, for boxes of at most 64.
    template <class Matrices, class State>
    void choose(const Matrices& m, State& at)
    {
        if (!m.traits().box || !m.traits().of_reactions() || m.own_reactions() > 64) return;
        if (!is_known_) {
            least_ = LeastReaction<M>(m.act(), m.own_reactions());
            is_known_ = true;
        }
        if (!least_.depend()) return;
        typename LeastReaction<M>::Reaction lower = at.reaction, upper = at.reaction, y, s;
        m.inclusion().bounds(at.t, at.w, lower, upper);
        m.observed(at.t, at.w, y);
        m.offset(at.t, s);
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            double terms = std::abs(s[i]);
            for (Eigen::Index c = 0; c < at.w.size(); ++c) {
                terms += std::abs(m.observe()(i, c) * at.w[c]);
            }
            if (std::abs(y[i]) > 1e-12 * terms) lower[i] = upper[i] = at.reaction[i];
        }
        least_.choose(lower, upper, at.reaction);
    }

private:
    LeastReaction<M> least_;
    bool is_known_ = false;
};

}  // namespace ricochet::detail
