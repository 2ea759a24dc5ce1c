// References of the problems for which steps are chosen, and comparison of runs with them.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/learn_steps/step_control.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::learn::detail {

inline constexpr std::size_t fault_samples = 600;

/// Velocities of a reference at even times, nondimensional, one column per time.
struct FaultReference {
    Eigen::MatrixXd velocity;
    double of_all = 0;     ///< sum of its squares
    double mean_slip = 0;  ///< [m]
};

/// The squared error of a run against the reference, from the parabolas of its steps.
class Comparison {
public:
    Comparison(const FaultReference& reference, double end)
        : reference_(reference), spacing_(end / static_cast<double>(fault_samples))
    {
    }

    [[nodiscard]] auto column() const
    {
        return reference_.velocity.col(static_cast<Eigen::Index>(next_ - 1));
    }

    void look(const BatheStep& step)
    {
        const auto& [a, b, c] = step.velocity;
        for (; next_ <= fault_samples; ++next_) {
            const double theta = (static_cast<double>(next_) * spacing_ - step.t) / step.h;
            if (theta > 1 + 1e-12) break;
            const double wa = (2 * theta - 1) * (theta - 1);
            const double wb = 4 * theta * (1 - theta);
            const double wc = theta * (2 * theta - 1);
            sum_ += (wa * *a + wb * *b + wc * *c - column()).squaredNorm();
        }
    }

    /// The square of the relative error so far, as a fraction of the whole run.
    [[nodiscard]] double squares() const { return sum_ / reference_.of_all; }

    /// Relative error; after the last step the motion counts as at rest.
    [[nodiscard]] double error()
    {
        for (; next_ <= fault_samples; ++next_) sum_ += column().squaredNorm();
        return std::sqrt(sum_ / reference_.of_all);
    }

private:
    const FaultReference& reference_;
    double spacing_;
    std::size_t next_ = 1;
    double sum_ = 0;
};

inline FaultReference reference_of(const StrikeSlipFault& fault, double t_end,
                                   double polynomial_bound, const StepWatch& watch = {})
{
    RuptureOptions options{.t_end = t_end,
                           .step = 0.01 * fault.time_unit(),
                           .rtol = std::numeric_limits<double>::infinity(),
                           .polynomial_bound = polynomial_bound};
    if (watch) options.progress = [&](double t) { return watch(t / t_end); };
    for (std::size_t i = 1; i <= fault_samples; ++i) {
        options.snapshot_times.push_back(i == fault_samples
                                             ? t_end
                                             : t_end * static_cast<double>(i) /
                                                   static_cast<double>(fault_samples));
    }
    const Rupture run = simulate(fault, options);
    if (run.snapshots.size() != fault_samples) {
        throw std::runtime_error(
            fmt::format("the reference of a fault of {0} x {0} elements ended early: {1}",
                        fault.elements(), describe(run.outcome)));
    }
    FaultReference out;
    out.velocity.resize(fault.size(), static_cast<Eigen::Index>(fault_samples));
    for (std::size_t i = 0; i < fault_samples; ++i) {
        out.velocity.col(static_cast<Eigen::Index>(i)) =
            run.snapshots[i].velocity / fault.velocity_unit();
    }
    out.of_all = out.velocity.squaredNorm();
    out.mean_slip = run.mean_slip;
    return out;
}

inline constexpr std::size_t samples = 2000;

/// States at even times, the start among them.
template <class System>
using Reference = std::vector<StateOf<System>>;

/// The parabola through the start, the middle stage and the end of a step. For step doubling the
/// middle stage is that of the second half.
struct StepParabola {
    double middle = 0.5;

    explicit StepParabola(ErrorEstimate estimate = ErrorEstimate::none)
        : middle(estimate == ErrorEstimate::doubling ? 0.75 : 0.5)
    {
    }

    /// Value at a fraction of the step.
    template <class System>
    [[nodiscard]] StateOf<System> state(const SetValuedMotion<System>& motion, double theta) const
    {
        const double wa = (theta - middle) * (theta - 1) / middle;
        const double wb = theta * (theta - 1) / (middle * (middle - 1));
        const double wc = theta * (theta - middle) / (1 - middle);
        return wa * motion.before().w + wb * motion.middle().w + wc * motion.state().w;
    }

    /// [1/s] Rate at its end.
    template <class System>
    [[nodiscard]] StateOf<System> rate(const SetValuedMotion<System>& motion) const
    {
        const double wa = (1 - middle) / middle;
        const double wb = 1 / (middle * (middle - 1));
        const double wc = (2 - middle) / (1 - middle);
        const double h = motion.state().t - motion.before().t;
        return (wa * motion.before().w + wb * motion.middle().w + wc * motion.state().w) / h;
    }
};

/// Visits the even times that a step covers.
template <class System>
class Samples {
public:
    explicit Samples(double t_end, ErrorEstimate estimate = ErrorEstimate::none)
        : spacing_(t_end / static_cast<double>(samples)), parabola_(estimate)
    {
    }

    template <class Use>
    void step(const SetValuedMotion<System>& motion, const Use& use)
    {
        const double t = motion.before().t;
        const double h = motion.state().t - t;
        for (; next_ <= samples; ++next_) {
            const double theta = (static_cast<double>(next_) * spacing_ - t) / h;
            if (theta > 1 + 1e-12) break;
            use(next_, parabola_.state(motion, theta));
        }
    }

private:
    double spacing_;
    StepParabola parabola_;
    std::size_t next_ = 1;
};

/// The exact solution.
inline Reference<SlidingMode> reference_of(const SlidingMode& system, double from, double t_end)
{
    Reference<SlidingMode> out;
    for (std::size_t i = 0; i <= samples; ++i) {
        const double t = t_end * static_cast<double>(i) / static_cast<double>(samples);
        out.push_back(SlidingMode::Vector::Constant(system.exact(t, from)));
    }
    return out;
}

inline Reference<DiodeCircuit> reference_of(const DiodeCircuit& system,
                                            const Eigen::Vector3d& start, double t_end)
{
    Reference<DiodeCircuit> out{start};
    // Order 2 with located switches: the error is about one millionth.
    SetValuedMotion<DiodeCircuit> motion(
        system, start,
        {.t_end = t_end, .step = 5e-4 * system.step_unit(), .switches = Switches::located});
    Samples<DiodeCircuit> at(t_end);
    while (motion.outcome() == Outcome::running) {
        (void)motion.advance();
        at.step(motion, [&](std::size_t, const Eigen::Vector3d& w) { out.push_back(w); });
    }
    // By rounding the last time may lie beyond the end.
    if (out.size() == samples) out.push_back(motion.state().w);
    if (motion.outcome() != Outcome::reached_end || out.size() != samples + 1) {
        throw std::runtime_error(fmt::format("the reference of a diode circuit ended early: {}",
                                             describe(motion.outcome())));
    }
    return out;
}

}  // namespace ricochet::learn::detail
