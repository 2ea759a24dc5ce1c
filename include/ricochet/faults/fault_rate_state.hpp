// Earthquakes of a strike-slip fault with rate-and-state friction: from years to microseconds.
//
//     const StrikeSlipFault fault({.elements = 25});
//     const RateStateRupture r = simulate(fault, {.t_end = 1e9}, FaultFriction{});
//
// The friction of StrikeSlipFault that weakens with slip is replaced by
//
//     rho L v' = -G/L K u - H u' + tau - sigma f(V, xi),    u = d - V_pl t,    xi' = xi'(V, xi)
//
// with a law of laws.hpp. The plates move at V_pl: a fault that slides with them
// everywhere loads nothing, one that is locked is loaded at the rate G/L K V_pl. Both u and its
// rate are relative to that motion, so that sliding at V_pl is steady.
//
// Steps are singly diagonally implicit of order 1, 2 or 4 (variational_step.hpp); a stage
// is that of fault_friction_stage.hpp.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "ricochet/detail/parameters.hpp"
#include "ricochet/faults/fault_rupture.hpp"

namespace ricochet {

/// Rate-and-state friction on a fault, its load and its start: uniform but for the normal stress.
struct FaultFriction {
    /// With these and the defaults of the fault its softest mode has 0.4 of the critical stiffness
    /// at the mean normal stress, and `elements_of_front` is 1 for 9 elements per side.
    RateStateParameters law{.a = 0.01, .b = 0.02, .f_star = 0.6, .v_star = 1e-6, .d_rs = 0.01};
    StateEvolution evolution = StateEvolution::ageing;
    DirectEffect effect = DirectEffect::asinh;
    double plate_velocity = 1e-9;  ///< V_pl [m/s], zero or positive
    double normal_stress = 0;      ///< sigma [Pa] of all elements; 0: that of the fault, with depth
    double slip_rate = 1e-9;       ///< V at the start [m/s], not zero; positive with the log form
    std::optional<double> theta{};  ///< [s] at the start, positive; none: steady at |slip_rate|
    /// tau = (1 + overload) sigma f at the start, above -1. With 0 a start at `plate_velocity` and
    /// its steady state continues sliding so, stable or not.
    double overload = 1e-5;
};

/// Options of runs with rate-and-state friction.
struct RateStateOptions {
    /// 1, 2 or 4. A step of order 4 that leaves an element creeping which it brakes to rest is
    /// taken again with order 2. The time of the first onset depends on the order: at rtol 1e-3
    /// order 4 is off by 1e-5 of it and order 2 by 5e-4; with the least `overload`, so that V is
    /// steady within that tolerance for most of the time, by 1.4e-3 and 9e-3. Order 4 costs 1.2
    /// to 1.5 times more.
    int order = 4;
    /// [s]; 0: |slip_rate| rho L / (a sigma), in which the direct effect ends an imbalance of the
    /// start, at most a hundredth of the run.
    double first_step = 0;
    double tolerance = 1e-11;  ///< of a stage's residual, relative to the sizes of its terms
    int max_iterations = 40;   ///< of Newton's method
    int max_inner = 200;       ///< of conjugate gradients, in one of them
    double threshold = 1e-3;   ///< [m/s] of the fastest element: onset and end of an earthquake
};

/// @throws std::invalid_argument naming the parameter or option, what was given and expected.
void validate(const FaultFriction& friction);
void validate(const RateStateOptions& options);

/// While the fastest element is above the threshold. Times are interpolated within a step.
struct FaultEarthquake {
    double start = 0;                                       ///< [s]
    double end = std::numeric_limits<double>::quiet_NaN();  ///< [s]; NaN: when the run ends
    double mean_slip = 0;                                   ///< [m]
    double largest_velocity = 0;                            ///< of an element [m/s]
};

/// Result of a run with rate-and-state friction.
struct RateStateRupture {
    /// Slip is d, and so are the means; `arrest_time` is relative to the fastest of all times.
    /// `statistics.rejected` are steps beyond the error or with a stage that was not solved.
    Rupture rupture;
    Eigen::VectorXd xi;  ///< log(V* theta / D_RS) at the end
    std::vector<FaultEarthquake> earthquakes;
    double residual = 0;             ///< largest of a stage of an accepted step
    std::uint64_t unsolved = 0;      ///< stages that were not solved, in rejected steps
    std::uint64_t inner = 0;         ///< iterations of conjugate gradients
    std::uint64_t handed_over = 0;   ///< attempts of order 4 that were taken with order 2
    std::vector<double> step_times;  ///< [s] ends of steps, the start first
    std::vector<double> fastest;     ///< [m/s] of any element then
    /// Elements in G D_RS / (sigma b), over which a rupture's front breaks down, at the largest
    /// normal stress: below 1 elements fail each on its own.
    double elements_of_front = 0;
};

/// Runs a fault. `RuptureOptions::step` is the longest step [s] (0: no limit); with an infinite
/// `rtol` the length of all. Errors of a step are root mean squares over the elements: of V
/// relative to it (and V* / 1e6), of xi against 1, of d against |u| + D_RS; the largest is compared
/// with `rtol`. A step with a stage that is not solved is repeated with a quarter of its length.
///
/// @throws std::invalid_argument for what `validate` refuses, constant steps without a length, and
/// a bound of the polynomial that cannot be met.
[[nodiscard]] RateStateRupture simulate(const StrikeSlipFault& fault, const RuptureOptions& options,
                                        const FaultFriction& friction,
                                        const RateStateOptions& how = {});

}  // namespace ricochet
