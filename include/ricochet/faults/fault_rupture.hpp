// The rupture of a strike-slip fault, by explicit steps in which every element's arrest is located.
//
//     const Rupture rupture = simulate(StrikeSlipFault({.elements = 100}), {.t_end = 30});
//
// Slip is not stiff: the fastest mode of 100 x 100 elements takes 0.7 s. Dormand and Prince's
// method of fifth order carries all elements that slip; those that do is settled at the start
// of a step. After it every element whose velocity has changed its sign is stopped where its own
// polynomial on the step is zero, and elements at rest that are driven beyond their strength start
// again. The order is 5 before the first arrest, 2 after it, and no step is repeated for an arrest.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <string_view>
#include <vector>

#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/integrate/outcome.hpp"

namespace ricochet {

/// Options of runs of the fault.
struct RuptureOptions {
    double t_end = std::numeric_limits<double>::quiet_NaN();  ///< [s]
    /// [s] the longest; 0: 0.29 time units, 0.25 s at 3 km, and n / 100 of it from n = 100 down to
    /// 10, where steps cost little. Never beyond 0.95 of what is stable.
    double step = 0;
    /// Error of a step allowed, relative to the present velocity and slip of the whole field;
    /// infinity: constant steps.
    double rtol = 1e-4;
    /// Error of the polynomial that stands for sqrt(K), relative on its whole spectrum; 0: 1e-4,
    /// and (n / 100)^2 of it from n = 100 down to 10.
    double polynomial_bound = 0;
    std::vector<double> snapshot_times{};  ///< [s] ascending
    std::uint64_t max_steps = 1'000'000;
    /// Asked after every step with the time [s]; false ends the run as `cancelled`.
    std::function<bool(double t)> progress{};
};

/// @throws std::invalid_argument naming the option, what was given and what was expected.
void validate(const RuptureOptions& options);

/// Fields over the elements, along x first.
struct RuptureSnapshot {
    double t = 0;              ///< [s]
    Eigen::VectorXd slip;      ///< [m]
    Eigen::VectorXd velocity;  ///< [m/s]
};

/// Counts over one run of the fault.
struct RuptureStatistics {
    std::uint64_t steps = 0;        ///< accepted
    std::uint64_t rejected = 0;     ///< by the error or for want of a solution
    std::uint64_t evaluations = 0;  ///< of forces
    std::uint64_t products = 0;     ///< with K
    std::uint64_t arrests = 0;
    std::uint64_t restarts = 0;
    std::uint64_t solves = 0;       ///< implicit stages
    std::uint64_t iterations = 0;   ///< of their Newton method
    std::uint64_t asked = 0;        ///< verdicts of a learned rule
    std::uint64_t handed_over = 0;  ///< of these, left to the classical one
    int degree = 0;                 ///< of the polynomial for sqrt(K)
    double bound = 0;               ///< its relative error at most
};

/// Result of a run of the fault.
struct Rupture {
    Outcome outcome = Outcome::reached_end;
    double t = 0;              ///< [s] reached
    double mean_slip = 0;      ///< path, mean over the square [m]
    double peak_velocity = 0;  ///< of the mean velocity [m/s]
    double peak_time = 0;      ///< [s]
    /// Time from which the mean velocity stays below 1e-3 of its peak [s]; of a single element,
    /// when it stops. NaN if it does not.
    double arrest_time = std::numeric_limits<double>::quiet_NaN();
    /// When the last element stopped [s]. NaN if one still moves, or could.
    double rest_time = std::numeric_limits<double>::quiet_NaN();
    double longest_step = 0;           ///< [s] allowed
    double stable_step = 0;            ///< [s] of the explicit method
    Eigen::VectorXd slip;              ///< [m]
    Eigen::VectorXd velocity;          ///< [m/s]
    Eigen::VectorXd peak_velocity_of;  ///< each element's largest at the nodes of the steps [m/s]
    Eigen::VectorXd arrival;           ///< when each was fastest [s]
    std::vector<double> times;         ///< [s] four for each step
    std::vector<double> mean_slips;    ///< [m]
    std::vector<double> mean_velocities;  ///< [m/s]
    std::vector<RuptureSnapshot> snapshots;
    RuptureStatistics statistics;
};

/// @throws std::invalid_argument for what `validate` refuses, and a bound of the polynomial that
/// cannot be met.
[[nodiscard]] Rupture simulate(const StrikeSlipFault& fault, const RuptureOptions& options);

/// The longest stable step of the explicit method for a mode of angular frequency 1 and this
/// damping ratio.
[[nodiscard]] double stable_step_of_mode(double damping);

}  // namespace ricochet
