// The incremental potential of one implicit step of a slider on a spring, and the condition
// for its convexity.
//
//     J(x, xi) = k/2 (x - x_p)^2 + m/2 ((x - 2 x_n + x_{n-1}) / h)^2
//                + N [h Ddag((x - x_n) / h, xi) + h^2 D((xi - xi_n) / h)]
//
// Its stationary points are the steps of backward Euler (Liu, Bhattacharya and Lapusta,
// arXiv 2507.09796, eqs. 16 to 18, with the k, m and N = m g that (18) and (19) leave
// out); where J is convex the step is its only stationary point.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "ricochet/faults/friction.hpp"

namespace ricochet {

/// A block that slides under a normal force, held by a spring.
struct SpringBlock {
    double mass = 1;             ///< m [kg], positive
    double stiffness = 1e4;      ///< k [N/m], zero or positive
    double normal_force = 9.81;  ///< N [N], positive
};

/// @throws std::invalid_argument naming the parameter.
void validate(const SpringBlock& block);

/// J at one point, its gradient and its Hessian.
struct IncrementalJet {
    double value = 0;
    double x = 0, xi = 0;              ///< [N], [J]
    double xx = 0, xxi = 0, xixi = 0;  ///< [N/m], [N], [J]
};

/// Start of a step, and its length.
struct IncrementalStart {
    double x = 0, x_before = 0;  ///< x_n and x_{n-1} [m]
    double xi = 0;               ///< xi_n
    double load = 0;             ///< x_p at the end of the step [m]
    double h = 0;                ///< length of the step [s]
};

/// J(x, xi), its gradient and its Hessian, for the step that begins at `start`.
template <PotentialPair Pair>
[[nodiscard]] IncrementalJet incremental_potential(const Pair& pair, const SpringBlock& block,
                                                   const IncrementalStart& start, double x,
                                                   double xi)
{
    const double h = start.h;
    const double stretch = x - start.load;
    const double jerk = (x - 2 * start.x + start.x_before) / h;  // change of the velocity
    const RateStateJet p = pair.rate_potential((x - start.x) / h, xi);
    const ScalarJet d = pair.primal((xi - start.xi) / h, start.xi);
    const double n = block.normal_force;
    return {block.stiffness / 2 * stretch * stretch + block.mass / 2 * jerk * jerk +
                n * h * (p.value + h * d.value),
            block.stiffness * stretch + block.mass / h * jerk + n * p.v,
            n * h * (p.xi + d.first),
            block.stiffness + block.mass / (h * h) + n / h * p.vv,
            n * p.vxi,
            n * (h * p.xixi + d.second)};
}

/// 1 - J_{x xi}^2 / (J_xx J_{xi xi}): positive where J is strictly convex, for J_xx and
/// J_{xi xi} positive; below zero otherwise.
[[nodiscard]] inline double convexity_margin(const IncrementalJet& j) noexcept
{
    if (!(j.xx > 0 && j.xixi > 0)) return -1;
    return 1 - j.xxi / j.xx * (j.xxi / j.xixi);
}

/// The margin of the exact pair of the ageing law (log form) at slip rate V after a step h:
///
///     convex  <=>  m/h^2 + k + N a / (V h) >= N b / (D_RS + h V* e^-xi)
[[nodiscard]] inline double ageing_convexity_margin(const RateStateParameters& p,
                                                    const SpringBlock& block, double h, double v,
                                                    double xi) noexcept
{
    const double stiff =
        block.mass / (h * h) + block.stiffness + block.normal_force * p.a / (v * h);
    return 1 - block.normal_force * p.b / (p.d_rs + h * p.v_star * std::exp(-xi)) / stiff;
}

/// The largest h [s] for which J of the exact pair of the ageing law is convex everywhere,
///
///     h = sqrt(m / (N b / D_RS - k)),
///
/// infinite for k >= N b / D_RS. It is sharp: beyond it J is not convex at high slip rate
/// and old state.
[[nodiscard]] inline double largest_convex_step(const RateStateParameters& p,
                                                const SpringBlock& block) noexcept
{
    const double excess = block.normal_force * p.b / p.d_rs - block.stiffness;
    return excess > 0 ? std::sqrt(block.mass / excess) : std::numeric_limits<double>::infinity();
}

/// The stiffness above which steady sliding at V is stable,
///
///     k_crit = N (b - a) / D_RS (1 + m V^2 / (N a D_RS))
///
/// (J.-C. Gu, J. R. Rice, A. L. Ruina and S. T. Tse, Journal of the Mechanics and Physics
/// of Solids 32, 1984; J. R. Rice and A. L. Ruina, Journal of Applied Mechanics 50, 1983).
/// Negative, that is, always stable, for a > b. [N/m]
[[nodiscard]] inline double critical_stiffness(const RateStateParameters& p, double mass,
                                               double normal_force, double v) noexcept
{
    return normal_force * (p.b - p.a) / p.d_rs * (1 + mass * v * v / (normal_force * p.a * p.d_rs));
}

}  // namespace ricochet
