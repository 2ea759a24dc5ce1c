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
#pragma once

#include <array>
#include <functional>
#include <memory>

#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"
#include "ricochet/nonsmooth/step_policy.hpp"

namespace ricochet {

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
