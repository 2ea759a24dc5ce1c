// Training of policies that choose steps (`nonsmooth/step_controllers.hpp`). The score of a policy
// is the work that it saves at the same true error.
//
//     const StepFamily family = fault_family({.seed = 1});
//     const TrainedStepPolicy trained = train_step_policy(family, {.seconds = 150});
//     save_model(trained.model, "fault-step.safetensors");
//
// A family is a set of problems of random parameters with reference solutions. A rule for steps
// is run on all of them at a few tolerances; its work is compared with that of the best classical
// rule that reaches the same true error. Weights are found by an evolution strategy on that score.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "ricochet/learn_steps/policies.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet {
class DiodeCircuit;
class SlidingMode;
class StrikeSlipFault;
}  // namespace ricochet

namespace ricochet::learn {

/// Callback that receives the fraction of the work that is done; returning false ends the run.
using StepWatch = std::function<bool(double done)>;

/// A rule with its tolerance, or with the length of constant steps.
struct StepRule {
    StepController controller = ErrorStep{.order = 3, .reject_above = 100};
    double tolerance = 1e-3;
    ErrorEstimate estimate = ErrorEstimate::embedded;
    /// First step (every step of a `ConstantStep`) in units of `StepProblem::usual_step`.
    double step = 1;
    /// Called after every step with the fraction of the time that is done; false ends the run
    /// early.
    StepWatch watch{};
};

/// First step [s] of a rule on a problem with the given usual step.
[[nodiscard]] double first_step(const StepRule& rule, double usual_step);

/// Work and errors of a rule on a problem.
struct StepTrial {
    bool ended = false;      ///< whether the run reached its end
    double work = 0;         ///< Newton iterations, or solves
    double error = 1;        ///< relative L2 over time
    double final_error = 1;  ///< relative, of the final slip or state
    std::uint64_t steps = 0;
    std::uint64_t rejected = 0;
    std::uint64_t solves = 0;
    std::uint64_t iterations = 0;
    std::uint64_t asked = 0;  ///< as in `LearnedStep`
    std::uint64_t handed_over = 0;
};

/// A problem with its reference. Threads may share it.
struct StepProblem {
    std::string description;
    int group = 0;          ///< problems of one group are compared together, e.g. all of one mesh
    double usual_step = 0;  ///< [s] the unit of `StepRule::step`
    std::function<StepTrial(const StepRule& rule)> run;
};

/// Problems of one system.
struct StepFamily {
    StepLayout layout;
    bool judges_final = false;  ///< the final error counts as much as the error over time
    std::vector<StepProblem> problems;
    std::vector<double> tolerances;  ///< tolerances used in a training
};

/// Ranges of the parameters of a family of faults.
struct FaultFamilyOptions {
    std::uint64_t seed = 1;
    /// Numbers of faults with 1 x 1, 2 x 2, ... elements.
    std::vector<int> counts{12, 10, 10};
};

/// Faults with random parameters around the defaults: side 2 to 6 km, damping ratio 0.15 to 0.45,
/// slip distance 0.05 to 0.2 m, drop of friction 0.05 to 0.2, overload 1e-6 to 1e-4. A fault that
/// does not rupture within 80 s is drawn again. Work is counted in Newton iterations; the
/// references are explicit runs with far shorter steps.
[[nodiscard]] StepFamily fault_family(const FaultFamilyOptions& options = {});

/// A fault as a problem. Its reference is an explicit run until `t_end` [s], which reports to
/// `watch`.
/// @throws std::runtime_error if that run ends early.
[[nodiscard]] StepProblem fault_problem(const StrikeSlipFault& fault, double t_end,
                                        double polynomial_bound = 0, const StepWatch& watch = {});

/// Sliding modes: gain, frequency and start within a factor of 2 of the defaults, amplitude 0.4 to
/// 0.95 of the gain; they slide for 30 to 85 % of the time. Work is counted in solves; the
/// reference is the closed-form solution.
[[nodiscard]] StepFamily sliding_mode_family(std::uint64_t seed = 1, int count = 24);
[[nodiscard]] StepProblem sliding_mode_problem(const SlidingMode& system, double from,
                                               double t_end);

/// Diode circuits: parameters within a factor of 1.5 of the defaults, starts within a factor of 2
/// and with any signs. Work is counted in solves; the references are runs of order 2 with located
/// switches and far shorter steps.
[[nodiscard]] StepFamily diode_circuit_family(std::uint64_t seed = 1, int count = 24);
[[nodiscard]] StepProblem diode_circuit_problem(const DiodeCircuit& system,
                                                const Eigen::Vector3d& start, double t_end);

/// The work of a rule against the error that it reaches, in logarithms, from coarse to fine.
class WorkCurve {
public:
    void add(double log_work, double log_error) { points_.push_back({log_work, log_error}); }
    /// Completes the curve; to be called once, after the last point. Errors are averaged over the
    /// interval of log work `share` on both sides, since they jump with the position of the steps.
    void finish(double share = 0);
    /// The log work beyond which the error stays below `log_error`; beyond the ends of the curve,
    /// extrapolated like a method of order 2.
    [[nodiscard]] double work_at(double log_error) const;

private:
    struct Point {
        double work;
        double error;
    };
    std::vector<Point> points_;
};

/// Scores of rules on a family.
class StepScore {
public:
    /// Runs the classical rules: the free estimate, rejecting above 100, and constant steps.
    StepScore(const StepFamily& family, unsigned threads);

    /// Mean over groups and tolerances of log(work / work of the best classical rule at the error
    /// reached) + 0.2 log(error / error of the free estimate at that tolerance)^2. Where the final
    /// error counts, the amount by which the work fails to be 5 % below that of the best classical
    /// rule at the final error reached is added. Less is better; a network that returns zero scores
    /// about 0. A smaller final error is not rewarded, since it is too often small by chance.
    [[nodiscard]] double operator()(const LearnedStep& rule) const;

    /// Terms of the score, for each group and each tolerance in it.
    struct Part {
        int group = 0;
        double tolerance = 0;
        double gain = 0;        ///< log of the factor saved in work, at the error reached
        double final_gain = 0;  ///< at the final error reached
        double off = 0;         ///< log(error / error of the classical rule)
        double failed = 0;      ///< fraction of the runs that did not reach the end
    };
    /// Terms of the score of `rule`, by group and tolerance.
    [[nodiscard]] std::vector<Part> parts(const LearnedStep& rule) const;

private:
    struct Group {
        int number = 0;
        std::vector<const StepProblem*> problems;
        std::vector<WorkCurve> of_error;
        std::vector<WorkCurve> of_final;
        std::vector<double> target;  ///< log error for each tolerance
    };
    const StepFamily& family_;
    std::vector<Group> groups_;
};

/// Result of a search for the steps of one run.
struct SearchedSteps {
    std::vector<double> lengths;  ///< [s]
    StepTrial trial;
};

/// Searches for the sequence of `count` step lengths with the least error, by an evolution strategy
/// that starts from equal lengths. The result is a yardstick for rules, which know only the past of
/// a run. It may exploit where a step happens to end, and is not proved to be optimal.
[[nodiscard]] SearchedSteps search_steps(const StepProblem& problem, std::size_t count,
                                         std::size_t evaluations, std::uint64_t seed = 1,
                                         unsigned threads = 2, const StepWatch& watch = {});

/// Options of a training of a step policy.
struct StepTrainingOptions {
    std::uint64_t seed = 1;
    std::size_t evaluations = 15'000;
    double seconds = std::numeric_limits<double>::infinity();
    unsigned threads = 2;
    std::filesystem::path checkpoint{};
    bool resume = false;
    /// Called at every step of every run, from several threads. If it returns false, the training
    /// ends promptly with `EvolutionOutcome::stopped`.
    std::function<bool()> goes_on{};
};

/// A trained step policy and its report.
struct TrainedStepPolicy {
    Model model;
    EvolutionResult search;
};

/// Returns `family` with runs that throw `SearchStopped` as soon as `goes_on` returns false.
[[nodiscard]] StepFamily stoppable(StepFamily family, std::function<bool()> goes_on);

/// Searches for the weights, starting from a network that returns zero. The domain of the model is
/// the range of inputs that the policy and the classical rule met on the family, widened by a
/// tenth. A training that was stopped has no domain yet; its checkpoint has the best weights found.
/// @throws as `evolve`.
[[nodiscard]] TrainedStepPolicy train_step_policy(const StepFamily& family,
                                                  const StepTrainingOptions& options = {},
                                                  const EvolutionCallback& progress = {});

}  // namespace ricochet::learn
