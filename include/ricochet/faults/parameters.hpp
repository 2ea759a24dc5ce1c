// Rate-and-state friction: its parameters and its laws.
//
//     f = f* + a log(V / V*) + b xi,      xi = log(V* theta / D_RS)
//
// with slip rate V [m/s] and the state theta [s], which follows an evolution law.
#pragma once

#include "ricochet/detail/arithmetic.hpp"

namespace ricochet {

/// Parameters of friction. The defaults are those of S. Liu, K. Bhattacharya and N. Lapusta,
/// Learning a potential formulation for rate-and-state friction, arXiv 2507.09796, 2025, eq. 12.
struct RateStateParameters {
    double a = 0.011;        ///< direct effect, positive
    double b = 0.016;        ///< effect of the state, positive; rate-weakening for b > a
    double f_star = 0.5109;  ///< steady friction coefficient at V*, positive
    double v_star = 1e-4;    ///< V* [m/s], positive
    double d_rs = 1e-6;      ///< D_RS [m], characteristic slip distance, positive
};

/// @throws std::invalid_argument naming the parameter, what is expected and what was found.
void validate(const RateStateParameters& parameters);

/// How friction depends on the slip rate.
enum class DirectEffect {
    log,    ///< a log(V / V*): V > 0 only
    asinh,  ///< a asinh(V / w): any V, and the same friction to rounding for V >> w
};

/// How the state follows the slip rate.
enum class StateEvolution {
    ageing,  ///< theta' = 1 - V theta / D_RS (Dieterich)
    slip,    ///< theta' = -(V theta / D_RS) log(V theta / D_RS) (Ruina)
    prz,     ///< theta' = 1 - (V theta / 2 D_RS)^2 (Perrin, Rice and Zheng)
};

/// Pair of potentials that represents a law exactly.
enum class PotentialKind {
    quadratic,               ///< D*(d) = d^2 / (2 b D_RS), of d alone and convex
    state_dependent_convex,  ///< D*(d; xi), convex in d for every state
    state_dependent,         ///< D*(d; xi), convex in d where V theta / D_RS >= 1/e
};

template <StateEvolution evolution>
inline constexpr PotentialKind potential_kind =
    evolution == StateEvolution::ageing ? PotentialKind::quadratic
    : evolution == StateEvolution::prz  ? PotentialKind::state_dependent_convex
                                        : PotentialKind::state_dependent;

namespace detail {

/// @throws std::invalid_argument: a slip rate for which the log form has no friction.
[[noreturn]] void refuse_slip_rate(double v);
/// @throws std::invalid_argument: theta is not positive.
[[noreturn]] void refuse_theta(double theta);

}  // namespace detail

}  // namespace ricochet
