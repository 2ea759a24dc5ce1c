// Linear variational inequalities of a few unknowns, solved case by case.
//
//     y = W reaction + y0,   each pair (reaction_i, y_i) on its own monotone graph
//
// Each graph has three branches: lower bound, inside, upper bound. For a given choice of
// branches the problem is a linear system, whose solution is that of the inequality if
// it lies on those branches. One unknown is solved by a formula. With too many unknowns for all
// cases to be tried, the solution is found by principal pivots.
#pragma once

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>

#include "ricochet/nonsmooth/detail/alignment.hpp"
#include "ricochet/nonsmooth/detail/ordered_products.hpp"
#include "ricochet/nonsmooth/inclusion.hpp"

namespace ricochet {

/// Branch of its graph on which a pair lies. For a set of reactions `inside` means sticking and a
/// bound means sliding; for a set of states `inside` means free and a bound means contact.
enum class Branch : signed char { lower = -1, inside = 0, upper = 1 };

/// The most unknowns that are solved by cases: 3^4 linear systems at worst.
inline constexpr int most_cases = 4;

/// A linear variational inequality of up to M unknowns, as at the head of this file. M may be
/// `Eigen::Dynamic`.
template <int M>
struct RICOCHET_ALIGNED LinearInequality {
    using Vector = Eigen::Matrix<double, M, 1>;
    using Matrix = Eigen::Matrix<double, M, M>;
    using Branches = Eigen::Matrix<Branch, M, 1>;

    /// Stands for W_ii where a reaction has no influence on its y, so that a required reaction goes
    /// to one bound or the other; the smallest double would overflow in y / W_ii.
    static constexpr double no_influence = 1e-100;

    Confines confines = Confines::reaction;
    Matrix w;  ///< W
    Vector y0;
    Vector lower, upper;  ///< of K
    /// Number of pairs, at most M, where that is fixed. Those behind it have no part in W; they are
    /// at the lower bound, 0, of a set of reactions, and inside a set of states.
    Eigen::Index unknowns = M;
    /// Whether the pairs of some choice of branches may depend on one another. Their reactions are
    /// then the nearest to `near` of those that hold their y.
    bool dependent = false;
    Vector near;

    /// The first component whose interval is empty or has a bound that is not a number; -1 if
    /// there is none.
    [[nodiscard]] int faulty() const noexcept
    {
        for (Eigen::Index i = 0; i < lower.size(); ++i) {
            if (!(lower[i] <= upper[i])) return static_cast<int>(i);
        }
        return -1;
    }

    /// Finds the solution on the first branches that fit. `branches` are tried before any others,
    /// and are overwritten. False if none was found.
    [[nodiscard]] bool solve(Vector& reaction, Vector& y, Branches& branches) const
    {
        if constexpr (M != Eigen::Dynamic) {
            for (Eigen::Index i = count(); i < M; ++i) {
                branches[i] = confines == Confines::reaction ? Branch::lower : Branch::inside;
                reaction[i] = 0;
                y[i] = y0[i];
            }
            if (count() == 1 && w(0, 0) > 0) return solve_one(reaction, y, branches);
        }
        return search(reaction, y, branches);
    }

    /// Tries the given branches, then all others; more than `most_cases` unknowns go to the pivots.
    /// True: `reaction`, `y` and `branches` are a solution.
    [[nodiscard]] bool search(Vector& reaction, Vector& y, Branches& branches) const;

    /// For any number of unknowns and a positive semidefinite W, even if reactions depend on one
    /// another: proximal steps from reaction = 0,
    ///
    ///     y = W reaction + y0 + eps (reaction - reaction before),
    ///
    /// each solved by principal pivots (J. J. Judice and F. M. Pires, A block principal pivoting
    /// algorithm for large-scale strictly monotone linear complementarity problems, Computers and
    /// Operations Research 21, 1994). False where pivots or proximal steps do not terminate, which
    /// can happen where W is indefinite, or where its rows differ in size by many orders.
    [[nodiscard]] bool solve_by_pivots(Vector& reaction, Vector& y, Branches& branches) const;

    /// The solution of the equations of the given branches, whether it lies on them or
    /// not. False if they have none.
    [[nodiscard]] bool solve_on(const Branches& branches, Vector& reaction, Vector& y) const;

    /// Whether a reaction on this branch holds its y at the target.
    [[nodiscard]] bool held(Branch branch) const noexcept
    {
        return confines == Confines::reaction ? branch == Branch::inside : branch != Branch::inside;
    }

    /// The smallest of the margins by which the pairs stay on their branches, in units of
    /// y or of the reaction; negative where a pair has left its branch.
    [[nodiscard]] double slack(const Branches& branches, const Vector& reaction,
                               const Vector& y) const
    {
        double least = std::numeric_limits<double>::infinity();
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            least = std::min(least, slack(i, branches[i], reaction[i], y[i]));
        }
        return least;
    }

    [[nodiscard]] double slack(Eigen::Index i, Branch branch, double reaction, double y) const
    {
        // The two kinds of set differ in which member of the pair is restricted.
        const bool of_reactions = confines == Confines::reaction;
        const double confined = of_reactions ? reaction : y;
        const double conjugate = of_reactions ? y : reaction;
        switch (branch) {
            case Branch::lower: return conjugate;
            case Branch::upper: return -conjugate;
            case Branch::inside: break;
        }
        return std::min(confined - lower[i], upper[i] - confined);
    }

    /// Sum of the sizes of the terms of y_i.
    [[nodiscard]] double terms(Eigen::Index i, const Vector& reaction) const
    {
        double sum = 0;
        for (Eigen::Index j = 0; j < y0.size(); ++j)
            sum += std::abs(w(i, j)) * std::abs(reaction[j]);
        return std::abs(y0[i]) + sum;
    }

private:
    [[nodiscard]] Eigen::Index count() const noexcept
    {
        if constexpr (M == Eigen::Dynamic) return y0.size();
        if constexpr (M == 1) return 1;
        return unknowns;
    }

    [[nodiscard]] double fixed_reaction(Eigen::Index i, Branch branch) const
    {
        if (confines == Confines::state) return 0;
        return branch == Branch::lower ? lower[i] : upper[i];
    }

    [[nodiscard]] double target(Eigen::Index i, Branch branch) const
    {
        if (confines == Confines::reaction) return 0;
        return branch == Branch::lower ? lower[i] : upper[i];
    }

    /// Reactions of held pairs that depend on one another: the nearest to `near`, in units of
    /// 1 / sqrt(W_ii), or not finite where they cannot hold all y. False where they are
    /// independent.
    [[nodiscard]] bool nearest_on(const Branches& branches, const Vector& b,
                                  Vector& reaction) const;

    /// Whether pair i is off its branch by more than the rounding of the products.
    [[nodiscard]] bool leaves(Eigen::Index i, Branch branch, const Vector& reaction,
                              const Vector& y) const
    {
        const bool about_y = (confines == Confines::reaction) != (branch == Branch::inside);
        const double of_y = terms(i, reaction);
        const double size = about_y ? of_y : std::max(std::abs(reaction[i]), of_y / w(i, i));
        return slack(i, branch, reaction[i], y[i]) < -1e-13 * size;
    }

    /// For a W whose principal minors are positive. Pairs that are off their branches change
    /// branch, all together while their number falls, and otherwise only the last of them.
    [[nodiscard]] bool pivot(Vector& reaction, Vector& y, Branches& branches) const
    {
        const Eigen::Index m = y0.size();
        Eigen::Index fewest = m + 1;
        int patience = 10;
        for (Eigen::Index pivots = 0; pivots < 100 * (m + 1); ++pivots) {
            for (Eigen::Index i = 0; i < m; ++i) {
                if (!held(branches[i]) && !std::isfinite(fixed_reaction(i, branches[i]))) {
                    branches[i] = Branch::inside;
                }
            }
            if (!solve_on(branches, reaction, y)) return false;
            Eigen::Index off = 0;
            Eigen::Index last = 0;
            for (Eigen::Index i = 0; i < m; ++i) {
                if (leaves(i, branches[i], reaction, y)) ++off, last = i;
            }
            if (off == 0) return true;
            if (off < fewest) {
                fewest = off;
                patience = 10;
            } else {
                --patience;
            }
            for (Eigen::Index i = patience >= 0 ? 0 : last; i <= last; ++i) {
                if (!leaves(i, branches[i], reaction, y)) continue;
                const double confined = confines == Confines::reaction ? reaction[i] : y[i];
                branches[i] = branches[i] != Branch::inside ? Branch::inside
                              : confined < lower[i]         ? Branch::lower
                                                            : Branch::upper;
            }
        }
        return false;
    }

    /// Whether all pairs are on their branches up to the rounding of the products.
    [[nodiscard]] bool fits(const Branches& branches, const Vector& reaction, const Vector& y) const
    {
        for (Eigen::Index i = 0; i < count(); ++i) {
            if (leaves(i, branches[i], reaction, y)) return false;
        }
        return true;
    }

    /// Whether the held reactions are determined by their y, and not by the rounding of a W that is
    /// singular for them, whose huge solutions cancel.
    [[nodiscard]] bool determines(const Branches& branches, const Vector& reaction) const
    {
        double given = 0, answers = 0;
        for (Eigen::Index i = 0; i < y0.size(); ++i) {
            if (!held(branches[i])) continue;
            double known = std::abs(y0[i]) + std::abs(target(i, branches[i]));
            double unknown = 0;
            for (Eigen::Index j = 0; j < y0.size(); ++j) {
                (held(branches[j]) ? unknown : known) += std::abs(w(i, j) * reaction[j]);
            }
            given = std::max(given, known);
            answers = std::max(answers, unknown);
        }
        return answers <= 1e12 * given;
    }

    [[nodiscard]] bool solve_one(Vector& reaction, Vector& y, Branches& branches) const
    {
        const double w11 = w(0, 0);
        if (confines == Confines::reaction) {
            const double holding = -y0[0] / w11;
            if (holding > lower[0] && holding < upper[0]) {
                branches[0] = Branch::inside;
                reaction[0] = holding;
                y[0] = 0;
            } else {
                branches[0] = holding >= upper[0] ? Branch::upper : Branch::lower;
                reaction[0] = holding >= upper[0] ? upper[0] : lower[0];
                y[0] = y0[0] + w11 * reaction[0];
                if (reaction[0] == holding) y[0] = 0;
            }
        } else {
            y[0] = std::min(std::max(y0[0], lower[0]), upper[0]);
            reaction[0] = y[0] == y0[0] ? 0 : (y[0] - y0[0]) / w11;
            branches[0] = y0[0] < lower[0]   ? Branch::lower
                          : y0[0] > upper[0] ? Branch::upper
                                             : Branch::inside;
        }
        return std::isfinite(reaction[0]) && std::isfinite(y[0]);
    }
};

/// Tries one choice of branches after the other, those that determine the reactions first.
template <int M>
bool LinearInequality<M>::search(Vector& reaction, Vector& y, Branches& branches) const
{
    const auto fit = [&] { return solve_on(branches, reaction, y) && fits(branches, reaction, y); };
    if (fit() && determines(branches, reaction)) return true;
    const int m = static_cast<int>(count());
    if (m > most_cases) return solve_by_pivots(reaction, y, branches);
    int count = 1;
    for (int i = 0; i < m; ++i) count *= 3;
    for (const bool any : {false, true}) {
        for (int code = 0; code < count; ++code) {
            for (int i = 0, rest = code; i < m; ++i, rest /= 3) {
                branches[i] = static_cast<Branch>(rest % 3 - 1);
            }
            if (fit() && (any || determines(branches, reaction))) return true;
        }
    }
    return false;
}

/// Takes proximal steps until they settle; each is a strictly monotone problem.
template <int M>
bool LinearInequality<M>::solve_by_pivots(Vector& reaction, Vector& y, Branches& branches) const
{
    LinearInequality strict = *this;
    const double largest = w.diagonal().cwiseAbs().maxCoeff();
    const Vector eps = (w.diagonal().cwiseAbs() * 1e-7).cwiseMax(1e-12 * largest);
    strict.w.diagonal() += eps;
    Vector before = y0;
    before.setZero();
    constexpr int most_steps = 1000;
    double unsettled = std::numeric_limits<double>::infinity();
    for (int step = 0; step < most_steps && unsettled > 1e-14; ++step) {
        strict.y0 = y0 - eps.cwiseProduct(before);
        if (!strict.pivot(reaction, y, branches)) return false;
        unsettled = 0;
        for (Eigen::Index i = 0; i < y0.size(); ++i) {
            // The part of y that the step adds, which a solution does not have.
            const double off = eps[i] * std::abs(reaction[i] - before[i]);
            if (off > 0) unsettled = std::max(unsettled, off / terms(i, reaction));
        }
        before = reaction;
    }
    if (!(unsettled <= 1e-10)) return false;
    y.noalias() = w * reaction;
    y += y0;
    for (Eigen::Index i = 0; i < y0.size(); ++i) {
        if (held(branches[i])) y[i] = target(i, branches[i]);
    }
    return y.allFinite();
}

/// Solves for the reactions that hold their y at its target; the others are known.
template <int M>
bool LinearInequality<M>::solve_on(const Branches& branches, Vector& reaction, Vector& y) const
{
    const Eigen::Index m = y0.size();
    y = y0;
    for (Eigen::Index i = 0; i < m; ++i) {
        reaction[i] = held(branches[i]) ? 0 : fixed_reaction(i, branches[i]);
        if (!std::isfinite(reaction[i])) return false;
    }
    // Reactions that hold their y at its target; the others are known.
    Matrix a = w;
    Vector b = y0;
    for (Eigen::Index i = 0; i < m; ++i) {
        if (held(branches[i])) {
            b[i] = target(i, branches[i]) - y0[i];
            for (Eigen::Index j = 0; j < m; ++j) {
                if (held(branches[j])) continue;
                b[i] -= w(i, j) * reaction[j];
                a(i, j) = 0;
            }
        } else {
            a.row(i).setZero();
            a(i, i) = 1;
            b[i] = reaction[i];
        }
    }
    if constexpr (M == 1) {
        reaction[0] = b[0] / a(0, 0);
    } else if (!dependent || !nearest_on(branches, b, reaction)) {
        reaction = a.partialPivLu().solve(b);
    }
    if (!reaction.allFinite()) return false;
    y.noalias() += detail::times(w, reaction);
    for (Eigen::Index i = 0; i < m; ++i) {
        if (held(branches[i])) y[i] = target(i, branches[i]);
    }
    return y.allFinite();
}

/// Finds, where reactions depend on one another, those nearest to `near` that hold their y.
template <int M>
bool LinearInequality<M>::nearest_on(const Branches& branches, const Vector& b,
                                     Vector& reaction) const
{
    constexpr int most = M == Eigen::Dynamic ? Eigen::Dynamic : M;
    using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most, most>;
    using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most, 1>;
    const Eigen::Index m = y0.size();
    Eigen::Index size = 0;
    for (Eigen::Index i = 0; i < m; ++i) size += held(branches[i]) && w(i, i) > 0;
    if (size < 2) return false;
    // With a diagonal of ones, so that the rank does not depend on units.
    Column root(size), left(size);
    Block scaled(size, size);
    const auto each_held = [&](auto&& visit) {
        for (Eigen::Index i = 0, k = 0; i < m; ++i) {
            if (held(branches[i]) && w(i, i) > 0) visit(i, k++);
        }
    };
    each_held([&](Eigen::Index i, Eigen::Index k) { root[k] = std::sqrt(w(i, i)); });
    each_held([&](Eigen::Index i, Eigen::Index k) {
        left[k] = b[i];
        each_held([&](Eigen::Index j, Eigen::Index l) {
            scaled(k, l) = w(i, j) / (root[k] * root[l]);
            left[k] -= w(i, j) * near[j];
        });
        left[k] /= root[k];
    });
    Eigen::CompleteOrthogonalDecomposition<Block> factor;
    factor.setThreshold(1e-12);
    factor.compute(scaled);
    if (factor.rank() == size) return false;
    const Column change = factor.solve(left);
    const double missed = (scaled * change - left).cwiseAbs().maxCoeff();
    if (!(missed <= 1e-10 * left.cwiseAbs().maxCoeff())) {
        reaction.setConstant(std::numeric_limits<double>::quiet_NaN());  // they cannot hold all y
        return true;
    }
    each_held([&](Eigen::Index i, Eigen::Index k) { reaction[i] = near[i] + change[k] / root[k]; });
    return true;
}

#if RICOCHET_ALIGNED_AS_LIBRARY
extern template struct LinearInequality<1>;
extern template struct LinearInequality<2>;
extern template struct LinearInequality<3>;
extern template struct LinearInequality<4>;
extern template struct LinearInequality<Eigen::Dynamic>;
#endif

}  // namespace ricochet
