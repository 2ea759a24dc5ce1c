// Steps chosen by reinforcement learning: a run as an environment, an action as a step.
//
//     const StepEnvironment runs = step_environment(StrikeSlipFault({.elements = 1}), 30);
//     const TrainedPolicy trained = train_tqc(runs.environment);
//     const StepTrial trial = follow(runs, trained.policy);   // its true errors
//
// An episode is one run of one problem. The action is the length of the next step, which is taken
// if its stages can be solved, however large its error, as in
//
//   D. M. Riley and others, "Reinforcement learning-based adaptive time-integration for nonsmooth
//   dynamics", section 4.
//
// There are three differences: work is counted rather than timed, so that runs repeat; the last
// step ends where the run does; and the observations are the intensive inputs of `StepPolicy`.
#pragma once

#include <cstdint>
#include <functional>
#include <numbers>

#include "ricochet/learn_steps/policies.hpp"
#include "ricochet/learn_steps/step_control.hpp"

namespace ricochet::learn {

/// Reward of a step.
enum class StepReward {
    /// The source's equation 7, with x = (h - h_min) / (h_max - h_min) of the step taken:
    ///
    ///     x (1 - (w - 1) / (expensive - 1)) exp(-alpha E),  or -x of a step that cannot be solved
    ///
    /// where w are the Newton iterations per solve, at most `expensive`; in systems whose solves
    /// all cost the same w = 1. E is the scaled error of the step.
    published,
    /// -work / work_unit - lambda (integral over the step of |y - y_ref|^2) / (integral of
    /// |y_ref|^2 over the run). The rewards of an episode add up to minus its cost and error.
    additive,
};

/// Map from an action in [-1, 1] to a step in [h_min, h_max].
enum class StepScale {
    linear,       ///< as in the source's code
    logarithmic,  ///< equal ratios
};

/// Rewards, steps and episodes of an environment.
struct StepEnvironmentOptions {
    StepReward reward = StepReward::published;
    double alpha = 2;       ///< zero or positive
    double expensive = 10;  ///< iterations per solve that earn nothing; above 1
    double lambda = 100;    ///< zero or positive
    double work_unit = 10;  ///< iterations of a fault, solves of other systems; positive
    StepScale scale = StepScale::logarithmic;
    double h_min = 1e-5;  ///< [s] positive
    double h_max = 0;     ///< [s] above h_min; 0: the source's
    /// `doubling` is the source's estimate, with its norm and its atol = tolerance / 1000; it costs
    /// six solves instead of two.
    ErrorEstimate estimate = ErrorEstimate::embedded;
    FirstStage first_stage = FirstStage::averaged;  ///< at_end: the source's
    double tolerance = 1e-3;                        ///< tolerance to which E is scaled, positive
    /// A fault's episode ends when nothing moves any more, nor ever will. The source continues.
    bool until_rest = false;
    std::uint64_t max_attempts = 20'000;  ///< then an episode is cut
    /// Called during the reference run and after every step of an episode; false ends them.
    StepWatch watch{};
};

/// The options with which the source trains.
[[nodiscard]] StepEnvironmentOptions published_step_environment(double alpha = 2);

/// Number of consecutive unsolvable steps after which an episode ends.
inline constexpr int step_environment_failures = 10;

/// An environment and the state of the run in it. Copies share the run.
struct StepEnvironment {
    /// Nine observations of order one: the error, length and fraction of switches of the last step,
    /// and the state as in the system's `StepLayout`. Every episode is the same run.
    Environment environment{};
    std::function<StepTrial()> trial{};                ///< of the episode, ended or not
    std::function<double(double action)> length_of{};  ///< [s]
    std::function<double(double length)> action_of{};  ///< its inverse
};

/// @throws std::invalid_argument naming the option, or as the systems' runs do.
[[nodiscard]] StepEnvironment step_environment(const StrikeSlipFault& fault, double t_end,
                                               const StepEnvironmentOptions& options = {});
[[nodiscard]] StepEnvironment step_environment(const SlidingMode& system, double from, double t_end,
                                               const StepEnvironmentOptions& options = {});
[[nodiscard]] StepEnvironment step_environment(const DiodeCircuit& system,
                                               const Eigen::Vector3d& start, double t_end,
                                               const StepEnvironmentOptions& options = {});

/// One episode by a deterministic policy as the trainers make it: action = tanh(network).
/// @throws std::invalid_argument if the model does not have the environment's inputs.
[[nodiscard]] StepTrial follow(const StepEnvironment& runs, const Model& policy);

}  // namespace ricochet::learn
