// A differential inclusion: smooth motion and set-valued reactions.
//
//     A w' = f(t, w) + G reaction,      y = E w - s(t)
//
// with, for a closed convex set K(t, w) of reactions,
//
//     -y in the normal cone of K at the reaction,
//
// so that the reaction opposes y with all that K allows, and takes whatever value in K
// keeps y at zero: a relay, dry friction, a diode, a unilateral contact. Where instead
// `confines` is Confines::state, K is a set that y must not leave, and -reaction is in
// the normal cone of K at y: stops, a saturated integrator.
//
// A system is a value with
//
//     state_size, reaction_size        static constexpr int, or Eigen::Dynamic with
//     size(), reactions()              member functions that tell
//     smooth(t, w, f)                  writes f
//     reaction_set(t, w)               K, a ConvexSet of dimension reaction_size
//
// and, where they differ from the default,
//
//     confines                         static constexpr Confines, reaction
//     affine                           static constexpr bool: f = B w + g(t), B constant
//     smooth_jacobian(t, w, J)         df/dw; by differences without it
//     mass(A)                          A, constant; the unit matrix
//     observe(E)                       E; selects the first components
//     act(G)                           G; the transpose of E
//     offset(t, s)                     s(t), continuous, the motion of what y is relative to; zero
//     offset_rate(t, s)                its rate; a difference without it, wrong beside a kink
//     branch_bound(t, w, i, branch)    a bound that goes on smoothly beyond y = 0, see
//                                      branch_modes.hpp
//     bound_gradient(t, w, i, g)       d upper_i / dw of a BoxSet of symmetric intervals
//                                      that depend on the state
//
// Vectors and matrices are Eigen's.
#pragma once

#include <Eigen/Dense>

#include <cmath>
#include <concepts>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "ricochet/nonsmooth/convex_sets.hpp"

namespace ricochet {

/// What the set of an inclusion holds.
enum class Confines {
    reaction,  ///< friction, relays, diodes, contacts
    state,     ///< stops
};

template <class System>
requires requires { System::state_size; }
inline constexpr int state_size = System::state_size;
template <class System>
requires requires { System::reaction_size; }
inline constexpr int reaction_size = System::reaction_size;

template <class System>
using StateOf = Eigen::Matrix<double, state_size<System>, 1>;
template <class System>
using ReactionOf = Eigen::Matrix<double, reaction_size<System>, 1>;
template <class System>
using SquareOf = Eigen::Matrix<double, state_size<System>, state_size<System>>;

template <class System>
concept Inclusion = requires(const System& system, double t, const StateOf<System>& w, StateOf<System>& f) {
    system.smooth(t, w, f);
    { system.reaction_set(t, w) } -> ConvexSet;
};

template <class System>
using SetOf = decltype(std::declval<const System&>().reaction_set(0.0, std::declval<const StateOf<System>&>()));

namespace detail {

template <class System>
constexpr Confines confines() noexcept
{
    if constexpr (requires { System::confines; }) {
        return System::confines;
    } else {
        return Confines::reaction;
    }
}

template <class System>
constexpr bool is_affine() noexcept
{
    if constexpr (requires { System::affine; }) {
        return System::affine;
    } else {
        return false;
    }
}

template <class System>
concept HasBoundGradient = requires(const System& system, double t, const StateOf<System>& w, int i, StateOf<System>& g) {
    system.bound_gradient(t, w, i, g);
};

/// @throws std::invalid_argument: "sliding mode: <what>".
[[noreturn]] void refuse_inclusion(std::string_view what);
[[noreturn]] void refuse_inclusion(std::string_view what, double given);

template <class V>
[[nodiscard]] std::span<double> span_of(V& v) noexcept
{
    return {v.data(), static_cast<std::size_t>(v.size())};
}
template <class V>
[[nodiscard]] std::span<const double> span_of(const V& v) noexcept
{
    return {v.data(), static_cast<std::size_t>(v.size())};
}

/// Df by central differences of relative step 6e-6, the cube root of the rounding unit.
template <class System>
void difference_jacobian(const System& system, double t, const StateOf<System>& w,
                         SquareOf<System>& jacobian)
{
    StateOf<System> moved = w;
    StateOf<System> ahead = w;
    StateOf<System> behind = w;
    for (Eigen::Index j = 0; j < w.size(); ++j) {
        const double step = 6e-6 * std::max(1.0, std::abs(w[j]));
        moved[j] = w[j] + step;
        system.smooth(t, moved, ahead);
        moved[j] = w[j] - step;
        system.smooth(t, moved, behind);
        moved[j] = w[j];
        jacobian.col(j) = (ahead - behind) / (2 * step);
    }
}

}  // namespace detail

/// A system with its constant matrices at hand, checked.
template <Inclusion System>
class InclusionMatrices {
public:
    static constexpr int N = state_size<System>;
    static constexpr int M = reaction_size<System>;
    using State = StateOf<System>;
    using Reaction = ReactionOf<System>;
    using Square = SquareOf<System>;
    using Observation = Eigen::Matrix<double, M, N, M == 1 && N != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    using Action = Eigen::Matrix<double, N, M, N == 1 && M != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    using Delassus = Eigen::Matrix<double, M, M>;

    /// @throws std::invalid_argument for a singular or non-finite A, or E or G that are not
    /// finite.
    explicit InclusionMatrices(const System& system) : system_(system)
    {
        const Eigen::Index n = size();
        const Eigen::Index m = reactions();
        mass_.setIdentity(n, n);
        if constexpr (requires(Square& a) { system.mass(a); }) system.mass(mass_);
        if (!mass_.allFinite()) detail::refuse_inclusion("the matrix A is not finite");
        const Eigen::FullPivLU<Eigen::MatrixXd> lu{Eigen::MatrixXd(mass_)};
        if (!lu.isInvertible()) {
            detail::refuse_inclusion("the matrix A is singular; its rank is",
                                     static_cast<double>(lu.rank()));
        }
        inverse_mass_ = lu.inverse();

        observe_.setZero(m, n);
        if constexpr (requires(Observation& e) { system.observe(e); }) {
            system.observe(observe_);
        } else {
            observe_.leftCols(m).setIdentity();
        }
        act_ = observe_.transpose();
        if constexpr (requires(Action& g) { system.act(g); }) system.act(act_);
        if (!observe_.allFinite() || !act_.allFinite()) {
            detail::refuse_inclusion("the matrices E and G must be finite");
        }
        find_selected();
    }

    [[nodiscard]] const System& system() const noexcept { return system_; }
    [[nodiscard]] Eigen::Index size() const
    {
        if constexpr (N == Eigen::Dynamic) {
            return static_cast<Eigen::Index>(system_.size());
        } else {
            return N;
        }
    }
    [[nodiscard]] Eigen::Index reactions() const
    {
        if constexpr (M == Eigen::Dynamic) {
            return static_cast<Eigen::Index>(system_.reactions());
        } else {
            return M;
        }
    }

    [[nodiscard]] const Square& mass() const noexcept { return mass_; }                   // A
    [[nodiscard]] const Square& inverse_mass() const noexcept { return inverse_mass_; }   // 1/A
    [[nodiscard]] const Observation& observe() const noexcept { return observe_; }        // E
    [[nodiscard]] const Action& act() const noexcept { return act_; }                     // G

    void smooth(double t, const State& w, State& f) const { system_.smooth(t, w, f); }

    void jacobian(double t, const State& w, Square& j) const
    {
        if constexpr (requires { system_.smooth_jacobian(t, w, j); }) {
            system_.smooth_jacobian(t, w, j);
        } else {
            detail::difference_jacobian(system_, t, w, j);
        }
    }

    /// s(t).
    void offset(double t, Reaction& s) const
    {
        s.setZero(reactions());
        if constexpr (requires { system_.offset(t, s); }) system_.offset(t, s);
    }

    /// y = E w - s(t).
    void observed(double t, const State& w, Reaction& y) const
    {
        offset(t, y);
        y = observe_ * w - y;
    }

    /// The component that row i of E selects, or -1 where it is not just one.
    [[nodiscard]] Eigen::Index selected(Eigen::Index i) const { return selected_[i]; }

    /// Writes y_i exactly into w where row i of E selects one component.
    void hold(Eigen::Index i, double y, double s, State& w) const
    {
        const Eigen::Index component = selected_[i];
        if (component >= 0) w[component] = s + y;
    }

private:
    void find_selected()
    {
        selected_.setConstant(reactions(), -1);
        for (Eigen::Index i = 0; i < reactions(); ++i) {
            Eigen::Index where = -1;
            int entries = 0;
            for (Eigen::Index j = 0; j < size(); ++j) {
                if (observe_(i, j) != 0) ++entries, where = j;
            }
            if (entries == 1 && observe_(i, where) == 1) selected_[i] = where;
        }
    }

    System system_;
    Square mass_, inverse_mass_;
    Observation observe_;
    Action act_;
    Eigen::Matrix<Eigen::Index, M, 1> selected_;
};

}  // namespace ricochet
