// A differential inclusion: smooth motion and set-valued reactions.
//
//     A w' = f(t, w) + G reaction,      y = E w - s(t)
//
// with, for a closed convex set K(t, w) of reactions,
//
//     -y in the normal cone of K at the reaction,
//
// so that the reaction minimises r . y over all r in K, and takes the value in K that
// keeps y at zero if there is one: a relay, dry friction, a diode, a unilateral contact. If
// `confines` is Confines::state instead, K is a set that y must not leave, and -reaction is in
// the normal cone of K at y: stops, a saturated integrator.
//
// A system is a value with
//
//     state_size, reaction_size        static constexpr int, or Eigen::Dynamic with
//     size(), reactions()              member functions that return them
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
//     offset(t, s)                     s(t), continuous, the motion that y is relative to; zero
//     offset_rate(t, s)                its rate; else a difference, which is wrong beside a kink
//     branch_bound(t, w, i, branch)    a bound that continues smoothly beyond y = 0, see
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

/// Quantity that the set of an inclusion restricts.
enum class Confines {
    reaction,  ///< friction, relays, diodes, contacts
    state,     ///< stops
};

template <class System>
requires requires
{
    System::state_size;
}
inline constexpr int state_size = System::state_size;
template <class System>
requires requires
{
    System::reaction_size;
}
inline constexpr int reaction_size = System::reaction_size;

template <class System>
using StateOf = Eigen::Matrix<double, state_size<System>, 1>;
template <class System>
using ReactionOf = Eigen::Matrix<double, reaction_size<System>, 1>;
template <class System>
using SquareOf = Eigen::Matrix<double, state_size<System>, state_size<System>>;

template <class System>
concept Inclusion = requires(const System& system, double t, const StateOf<System>& w,
                             StateOf<System>& f)
{
    system.smooth(t, w, f);
    {
        system.reaction_set(t, w)
        } -> ConvexSet;
};

template <class System>
using SetOf = decltype(std::declval<const System&>().reaction_set(
    0.0, std::declval<const StateOf<System>&>()));

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

/// @throws std::invalid_argument with the message "inclusion: <what> <given>".
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

}  // namespace detail

}  // namespace ricochet
