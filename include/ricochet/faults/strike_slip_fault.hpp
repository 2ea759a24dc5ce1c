// A vertical strike-slip fault that slips in an earthquake.
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "ricochet/faults/fault_stiffness.hpp"
#include "ricochet/faults/parameters.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"
#include "ricochet/run.hpp"

namespace ricochet {

/// Medium around the fault.
enum class FaultMedium {
    full_space,  ///< unbounded elastic medium: K depends on distances alone
    half_space,  ///< elastic half-space whose free surface, at depth 0, the fault reaches
};

/// How the square is cut into elements.
enum class FaultMesh {
    plain,  ///< n x n elements of side L / n
    /// n x n elements of side L / (n + 1/2), a quarter of an element away from every edge. The slip
    /// goes to zero at the edges like a square root, and the discretisation error decreases faster.
    tip_corrected,
};

/// A square fault of n x n elements, each with one slip along the strike, under Coulomb friction
/// that weakens with slip (D. M. Riley and others, Reinforcement Learning-based adaptive
/// time-integration for nonsmooth dynamics, section 5.3).
///
/// With slip d from the start, accumulated slip s, velocity v and mean density of mass rho L,
///
///     d' = v,   s' = |v|
///     rho L v' = -G/L K d - H v + tau - r,    r in b(s) Sign(v)
///     b = (residual + drop exp(-s / slip_distance)) sigma,    H = 2 zeta sqrt(rho G K)
///
/// sigma, the effective normal stress, grows with depth. The initial stress, tau = (1 + overload)
/// b(0), slightly exceeds the strength everywhere. K is the stiffness of the medium times L and a
/// factor such that the mean slip under a uniform drop of friction equals that of a spring of
/// stiffness G / L: for one element, K = 1.
///
/// From an unstable rest the time of the rupture depends on the overload: each decade moves its
/// peak by 1.6 s (side 3 km).
///
/// All quantities are nondimensional: slip in units of slip_distance, time in units of `time_unit`,
/// hence
///
///     v' = overload b(0) + b(0) - b(s) - K d - H v   where v > 0,   H = 2 zeta sqrt(K).
class StrikeSlipFault {
public:
    struct Parameters {
        int elements = 1;                ///< n, per side, positive
        double side = 3000;              ///< L [m], positive
        double shear_modulus = 30e9;     ///< G [Pa], positive
        double poisson = 0.25;           ///< in [0, 0.5)
        double density = 2500;           ///< rho [kg/m^3], positive
        double damping = 0.8 / 3;        ///< zeta, zero or positive
        double stress_gradient = 15e3;   ///< of sigma [Pa/m], positive
        double residual_friction = 0.5;  ///< zero or positive
        double friction_drop = 0.1;      ///< positive
        double slip_distance = 0.1;      ///< [m], positive
        double overload = 1e-5;          ///< positive
        FaultMedium medium = FaultMedium::full_space;
        FaultMesh mesh = FaultMesh::plain;
        /// A .npy or .safetensors file with the stresses due to slip, n^2 x n^2 [1/km], symmetric
        /// and negative definite, to be used instead of those of the medium; the mesh must be
        /// plain.
        std::filesystem::path kernel{};
        double memory_limit = 1073741824;  ///< [bytes], positive
    };

    /// @throws std::invalid_argument for a parameter out of range, a mesh that needs more
    /// memory than the limit, or a kernel that does not fit.
    explicit StrikeSlipFault(const Parameters& parameters);
    StrikeSlipFault() : StrikeSlipFault(Parameters{}) {}

    static constexpr std::string_view name = "fault";

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }
    [[nodiscard]] int elements() const noexcept { return p_.elements; }
    [[nodiscard]] Eigen::Index size() const noexcept { return weight_.size(); }
    [[nodiscard]] const FaultStiffness& stiffness() const noexcept { return *stiffness_; }
    [[nodiscard]] double factor() const noexcept { return factor_; }

    [[nodiscard]] double time_unit() const noexcept { return time_unit_; }  ///< L sqrt(rho/G) [s]
    [[nodiscard]] double slip_unit() const noexcept { return p_.slip_distance; }  ///< [m]
    [[nodiscard]] double velocity_unit() const noexcept { return slip_unit() / time_unit_; }
    /// Fraction of the square's area that one element covers.
    [[nodiscard]] double share() const noexcept { return share_; }
    /// Mean over the square of a field on the elements, zero elsewhere.
    [[nodiscard]] double mean(const Eigen::VectorXd& field) const { return share_ * field.sum(); }
    /// Depth [m] of the centres of row `row`.
    [[nodiscard]] double depth(int row) const noexcept;

    /// sigma L / (G slip_distance) of each element.
    [[nodiscard]] const Eigen::VectorXd& weight() const noexcept { return weight_; }
    /// b(s) of an element, nondimensional.
    [[nodiscard]] double strength(Eigen::Index which, double path) const;
    /// b(0) - b(s) of an element.
    [[nodiscard]] double weakening(Eigen::Index which, double path) const;

    /// Memory [bytes] that a fault with these parameters and a run of it need; nothing is
    /// allocated.
    [[nodiscard]] static double memory(const Parameters& parameters) noexcept;

private:
    Parameters p_;
    std::optional<FaultStiffness> stiffness_;
    double factor_ = 1;
    double time_unit_ = 1;
    double share_ = 1;
    double element_ = 1;  // side of an element over L
    double inset_ = 0;    // its distance from the edge, over L
    Eigen::VectorXd weight_;
};

// The rupture of a strike-slip fault, by explicit steps in which every element's arrest is located.
//
//     const Rupture rupture = simulate(StrikeSlipFault({.elements = 100}), {.t_end = 30});
//
// Slip is not stiff: the fastest mode of 100 x 100 elements takes 0.7 s. The fifth-order method of
// Dormand and Prince integrates all slipping elements; which elements slip is decided at the start
// of a step. After the step, every element whose velocity has changed sign is stopped where its own
// polynomial on the step is zero, and elements at rest that are loaded beyond their strength start
// to slip again. The order is 5 before the first arrest and 2 after it, and no step is repeated for
// an arrest.

/// Options of runs of the fault.
struct RuptureOptions {
    double t_end = std::numeric_limits<double>::quiet_NaN();  ///< [s]
    /// [s] Longest step; 0: 0.29 time units, which is 0.25 s at 3 km, reduced to n / 100 of it as n
    /// falls from 100 to 10, where steps cost little. Limited to 0.95 of the stable step.
    double step = 0;
    /// Allowed error of a step, relative to the present velocity and slip of the whole field;
    /// infinity: constant steps.
    double rtol = 1e-4;
    /// Largest relative error, over the spectrum of K, of the polynomial that replaces sqrt(K); 0:
    /// 1e-4, times (n / 100)^2 as n falls from 100 to 10.
    double polynomial_bound = 0;
    std::vector<double> snapshot_times{};  ///< [s] ascending
    std::uint64_t max_steps = 1'000'000;
    /// Called after every step with the time [s]; if it returns false, the run ends as `cancelled`.
    std::function<bool(double t)> progress{};
};

/// Validates options. @throws std::invalid_argument naming the option, what was given and expected.
void validate(const RuptureOptions& options);

/// Slip and velocity of all elements at one time; the index along x varies fastest.
struct RuptureSnapshot {
    double t = 0;              ///< [s]
    Eigen::VectorXd slip;      ///< [m]
    Eigen::VectorXd velocity;  ///< [m/s]
};

/// Counts over one run of the fault.
struct RuptureStatistics {
    std::uint64_t steps = 0;        ///< accepted steps
    std::uint64_t rejected = 0;     ///< steps that failed the error test or had no solution
    std::uint64_t evaluations = 0;  ///< evaluations of the forces
    std::uint64_t products = 0;     ///< with K
    std::uint64_t arrests = 0;
    std::uint64_t restarts = 0;
    std::uint64_t solves = 0;       ///< solutions of implicit stages
    std::uint64_t iterations = 0;   ///< iterations of Newton's method in them
    std::uint64_t asked = 0;        ///< verdicts of a learned rule
    std::uint64_t handed_over = 0;  ///< of these, left to the classical rule
    int degree = 0;                 ///< of the polynomial for sqrt(K)
    double bound = 0;               ///< bound of its relative error
};

/// Result of a run of the fault.
struct Rupture {
    Outcome outcome = Outcome::reached_end;
    double t = 0;              ///< [s] reached
    double mean_slip = 0;      ///< accumulated slip, mean over the square [m]
    double peak_velocity = 0;  ///< largest mean velocity [m/s]
    double peak_time = 0;      ///< time of the largest mean velocity [s]
    /// Time from which the mean velocity stays below 1e-3 of its peak [s]; of a single element,
    /// when it stops. NaN if it does not.
    double arrest_time = std::numeric_limits<double>::quiet_NaN();
    /// Time at which the last element stopped [s]. NaN if an element still moves or may move again.
    double rest_time = std::numeric_limits<double>::quiet_NaN();
    double longest_step = 0;           ///< [s] allowed
    double stable_step = 0;            ///< [s] of the explicit method
    Eigen::VectorXd slip;              ///< [m]
    Eigen::VectorXd velocity;          ///< [m/s]
    Eigen::VectorXd peak_velocity_of;  ///< largest velocity of each element at ends of steps [m/s]
    Eigen::VectorXd arrival;           ///< time at which each element was fastest [s]
    std::vector<double> times;         ///< [s] four for each step
    std::vector<double> mean_slips;    ///< [m]
    std::vector<double> mean_velocities;  ///< [m/s]
    std::vector<RuptureSnapshot> snapshots;
    RuptureStatistics statistics;
};

/// Simulates the rupture of a fault by explicit steps.
/// @throws std::invalid_argument for options that `validate` refuses, and for a polynomial bound
/// that cannot be met.
[[nodiscard]] Rupture simulate(const StrikeSlipFault& fault, const RuptureOptions& options);

/// The longest stable step of the explicit method for a mode of angular frequency 1 and this
/// damping ratio.
[[nodiscard]] double stable_step_of_mode(double damping);

// Earthquakes of a strike-slip fault with rate-and-state friction: from years to microseconds.
//
//     const StrikeSlipFault fault({.elements = 25});
//     const RateStateRupture r = simulate(fault, {.t_end = 1e9}, FaultFriction{});
//
// The friction of StrikeSlipFault that weakens with slip is replaced by
//
//     rho L v' = -G/L K u - H u' + tau - sigma f(V, xi),    u = d - V_pl t,    xi' = xi'(V, xi)
//
// with a law of friction.hpp. The plates move at V_pl: a fault that slides at this velocity
// everywhere is not loaded, a locked fault is loaded at the rate G/L K V_pl. Both u and its rate
// are relative to that motion, so that sliding at V_pl is steady.
//
// Steps are singly diagonally implicit of order 1, 2 or 4 (variational_step.hpp); a stage
// is that of fault_friction_stage.hpp.

/// Rate-and-state friction on a fault, its load and its start; uniform except for normal stress.
struct FaultFriction {
    /// With this law and the default fault, the softest mode has 0.4 of the critical stiffness
    /// at the mean normal stress, and `elements_of_front` is 1 for 9 elements per side.
    RateStateParameters law{.a = 0.01, .b = 0.02, .f_star = 0.6, .v_star = 1e-6, .d_rs = 0.01};
    StateEvolution evolution = StateEvolution::ageing;
    DirectEffect effect = DirectEffect::asinh;
    double plate_velocity = 1e-9;  ///< V_pl [m/s], zero or positive
    double normal_stress = 0;      ///< sigma [Pa] of all elements; 0: that of the fault, with depth
    double slip_rate = 1e-9;       ///< V at the start [m/s], not zero; positive with the log form
    std::optional<double> theta{};  ///< [s] at the start, positive; empty: steady at |slip_rate|
    /// tau = (1 + overload) sigma f at the start; above -1. With 0, a start at `plate_velocity` in
    /// its steady state continues to slide at that velocity, whether this is stable or not.
    double overload = 1e-5;
};

/// Options of runs with rate-and-state friction.
struct RateStateOptions {
    /// Order of the method: 1, 2 or 4. If a step of order 4 brakes an element to rest but leaves it
    /// creeping, the step is repeated with order 2. The time of the first onset depends on the
    /// order. At rtol 1e-3 its relative error is 1e-5 with order 4 and 5e-4 with order 2; with the
    /// least `overload`, for which V is steady within that tolerance most of the time, 1.4e-3 and
    /// 9e-3. Order 4 costs 1.2 to 1.5 times more.
    int order = 4;
    /// [s]; 0: |slip_rate| rho L / (a sigma), the time in which the direct effect balances the
    /// stresses of the start, but at most a hundredth of the run.
    double first_step = 0;
    double tolerance = 1e-11;  ///< for the residual of a stage, relative to its terms
    int max_iterations = 40;   ///< iterations of Newton's method in a stage
    int max_inner = 200;       ///< iterations of conjugate gradients in one Newton iteration
    double threshold = 1e-3;   ///< [m/s] of the fastest element: onset and end of an earthquake
};

/// Validate. @throws std::invalid_argument naming parameter or option, what was given and expected.
void validate(const FaultFriction& friction);
void validate(const RateStateOptions& options);

/// An earthquake: the fastest element is above the threshold. Times are interpolated in a step.
struct FaultEarthquake {
    double start = 0;                                       ///< [s]
    double end = std::numeric_limits<double>::quiet_NaN();  ///< [s]; NaN: when the run ends
    double mean_slip = 0;                                   ///< [m]
    double largest_velocity = 0;                            ///< of an element [m/s]
};

/// Result of a run with rate-and-state friction.
struct RateStateRupture {
    /// `slip` is d, and the means are means of d; `arrest_time` is relative to the largest mean
    /// velocity of the run. `statistics.rejected` counts steps whose error was too large or that
    /// had an unsolved stage.
    Rupture rupture;
    Eigen::VectorXd xi;  ///< log(V* theta / D_RS) at the end
    std::vector<FaultEarthquake> earthquakes;
    double residual = 0;             ///< largest of a stage of an accepted step
    std::uint64_t unsolved = 0;      ///< stages that were not solved, in rejected steps
    std::uint64_t inner = 0;         ///< iterations of conjugate gradients
    std::uint64_t handed_over = 0;   ///< attempts of order 4 that were taken with order 2
    std::vector<double> step_times;  ///< [s] ends of steps, the start first
    std::vector<double> fastest;     ///< [m/s] velocity of the fastest element at these times
    /// Number of elements in the length G D_RS / (sigma b) over which strength drops at a rupture
    /// front, at the largest normal stress: below 1 each element fails on its own.
    double elements_of_front = 0;
};

/// Runs a fault with rate-and-state friction. `RuptureOptions::step` is the longest step [s] (0: no
/// limit); with an infinite `rtol`, the length of all steps. The error of a step is the largest of
/// three root mean squares over the elements: of V relative to V (and to V* / 1e6), of xi relative
/// to 1, and of d relative to |u| + D_RS; it is compared with `rtol`. A step with an unsolved stage
/// is repeated with a quarter of its length.
///
/// @throws std::invalid_argument for options that `validate` refuses, for constant steps without a
/// length, and for a polynomial bound that cannot be met.
[[nodiscard]] RateStateRupture simulate(const StrikeSlipFault& fault, const RuptureOptions& options,
                                        const FaultFriction& friction,
                                        const RateStateOptions& how = {});

// The rupture of a strike-slip fault by Bathe's implicit steps, for stiff variants, for comparison
// with published runs, and for rules that choose the step.
//
//     const Rupture r = simulate(fault, {.t_end = 30, .step = 0.125}, BatheOptions{});
//
// A stage over g (a quarter or a third of the step) is the convex problem
//
//     A v + g b(s + g |v|) Sign(v)  contains  w,     A = 1 + g H + g^2 K
//
// This problem is convex as long as g^2 times the steepest weakening is below the least eigenvalue
// of A: steps up to 1.5 s at 3 km. The problem is solved by a semismooth Newton method. The
// proximal map decides which elements slip forward, slip backward or stick, and the linear system
// of the slipping elements is solved by conjugate gradients. A is one polynomial in K.

/// Accumulated slip at which the strength in a stage is evaluated.
enum class FaultBound {
    implicit,  ///< at the end of the stage
    /// at the slip extrapolated with the initial velocity of the stage: always convex, also order 2
    extrapolated,
};

/// How the errors of velocity and slip are combined into one number.
enum class FaultNorm {
    /// the larger of the errors of velocity and slip, each as a root mean square over rtol times
    /// that of the field itself, which counts as at least `BatheOptions::floor` of the largest
    /// velocity so far
    fields,
    /// root mean square over all components of error / (atol + rtol |component|), of velocity,
    /// displacement from the unloaded state, and path, in units of 0.1 mm, as the published code
    components,
};

/// A step that was taken, nondimensional (`StrikeSlipFault`): the fields at its start, at the end
/// of its first stage and at its end.
struct BatheStep {
    double t = 0;  ///< start of the step
    double h = 0;
    std::array<const Eigen::VectorXd*, 3> velocity{};
    std::array<const Eigen::VectorXd*, 3> path{};
};

/// Options of implicit runs of the fault.
struct BatheOptions {
    FirstStage first_stage = FirstStage::averaged;  ///< or at_end, the published scheme: order 1
    FaultBound bound = FaultBound::implicit;
    /// The first step, or all of them, is `RuptureOptions::step`, positive.
    StepController controller = ConstantStep{};
    ErrorEstimate estimate = ErrorEstimate::none;
    FaultNorm norm = FaultNorm::fields;
    double rtol = 1e-3;
    double atol = 1e-6;       ///< of FaultNorm::components
    double floor = 0.03;      ///< of FaultNorm::fields: relative to the largest velocity so far
    double h_max = 0;         ///< [s]; 0: a fifth of the run
    double tolerance = 1e-7;  ///< residual of a stage, relative to its velocities
    int max_iterations = 50;  ///< iterations of Newton's method in a stage
    int max_inner = 200;      ///< iterations of conjugate gradients in one Newton iteration
    /// Called after every step; with step doubling, once for each half.
    std::function<void(const BatheStep&)> observer{};
};

/// Inputs of a step policy for the fault: of the fields at the end of an attempt, nondimensional,
/// the logarithm of the root mean square velocity, the rate of growth of its square (half of it, as
/// asinh) and the logarithm of the time in which it would vanish at that rate, the mean of
/// exp(-path), the fraction of elements that slip, and the logarithm of the mean drop of strength.
[[nodiscard]] const StepLayout& fault_step_layout() noexcept;

/// Validates the options. @throws std::invalid_argument naming the option.
void validate(const BatheOptions& options);

/// Runs the fault by Bathe's steps. `RuptureOptions::rtol` is not used. The time of rest is known
/// to within one step.
/// @throws std::invalid_argument for options that either `validate` refuses, and for a polynomial
/// bound that cannot be met.
[[nodiscard]] Rupture simulate(const StrikeSlipFault& fault, const RuptureOptions& options,
                               const BatheOptions& bathe);

/// A run whose steps are chosen from outside, one at a time.
///
///     BatheMotion motion = runs.start(options, bathe);
///     while (!motion.ended()) motion.step(h);
///
/// The steps are those of `simulate`, bit for bit. The `BatheRuns` that made the motion must
/// outlive it.
class BatheMotion {
public:
    /// Moves the run; made by `BatheRuns::start`.
    BatheMotion(BatheMotion&&) noexcept;
    BatheMotion& operator=(BatheMotion&&) noexcept;
    ~BatheMotion();

    /// Attempts one step over h [s], positive, or over the remaining time if that is shorter.
    /// Returns false if a stage has no solution; then nothing has moved. The controller of the
    /// options is not used.
    bool step(double h);

    /// Whether the run has ended.
    [[nodiscard]] bool ended() const noexcept;
    [[nodiscard]] double t() const noexcept;  ///< [s]
    /// Whether the fault is at rest and will stay at rest.
    [[nodiscard]] bool rests();
    /// The scaled error of the last step; 0 if none is estimated.
    [[nodiscard]] double error() const noexcept;
    /// View of the last step, or of the start, for a step policy.
    [[nodiscard]] const StepView& view() const noexcept;
    [[nodiscard]] const RuptureStatistics& statistics() const noexcept;
    [[nodiscard]] double mean_slip() const;  ///< accumulated slip [m]

private:
    friend class BatheRuns;
    struct Parts;
    explicit BatheMotion(std::unique_ptr<Parts> parts);
    std::unique_ptr<Parts> parts_;
};

/// Runs of one fault under many rules. Quantities that depend on the fault alone, which take 0.3 ms
/// for one element, are computed once. Not for use by two threads at a time.
class BatheRuns {
public:
    /// @param polynomial_bound  in place of `RuptureOptions::polynomial_bound`
    explicit BatheRuns(const StrikeSlipFault& fault, double polynomial_bound = 0);
    BatheRuns(BatheRuns&&) noexcept;
    BatheRuns& operator=(BatheRuns&&) noexcept;
    ~BatheRuns();

    [[nodiscard]] const StrikeSlipFault& fault() const noexcept;
    /// Runs like the function `simulate`, with the products of this fault computed once.
    [[nodiscard]] Rupture simulate(const RuptureOptions& options, const BatheOptions& bathe);
    /// Starts a run that the caller steps; it must end before another begins.
    /// `RuptureOptions::step` must be positive but is not used.
    [[nodiscard]] BatheMotion start(const RuptureOptions& options, const BatheOptions& bathe);

private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace ricochet
