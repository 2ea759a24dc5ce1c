// Rules of step control on one problem, each by a ladder of settings.
#pragma once

#include "studies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "faults/step_progress.hpp"
#include "interrupt.hpp"
#include "learn/step_environment.hpp"
#include "policy_lookup.hpp"

namespace ricochet::app {

using learn::StepProblem;
using learn::StepRule;
using learn::StepTrial;

inline constexpr double inf = std::numeric_limits<double>::infinity();
inline constexpr std::size_t samples = 600;

// Names of rows that are references and need not reach the target.
inline constexpr std::string_view searched = "searched sequence";
inline constexpr std::string_view reinforced = "TQC, eq. 7";

inline bool is_yardstick(const std::string& rule)
{
    return rule == searched || rule == reinforced;
}

/// Thrown while a rule is run; the rule is then left out.
struct Interrupted {};

inline void check_interrupt()
{
    if (Interrupts::any()) throw Interrupted{};
}

/// The same problem; after an interrupt no run of it begins.
inline StepProblem interruptible(StepProblem problem)
{
    problem.run = [run = std::move(problem.run)](const StepRule& rule) {
        check_interrupt();
        return run(rule);
    };
    return problem;
}

struct RuleRow {
    std::string rule{};
    std::string setting{};
    StepTrial trial{};
    double seconds = 0;
    bool reached = false;
    int given_up = 0;  ///< number of settings given up because the run stalled
};

/// A problem that the policy of its system was not trained for.
struct Beyond {
    std::string what;
    std::function<StepProblem(const learn::StepWatch& watch)> problem;
};

/// A problem with its particular settings.
struct Case {
    std::string system;
    StepProblem problem;
    StepLayout layout;
    double target = 1e-2;
    double coarsest = 0.1;     ///< tolerance at which a ladder begins
    double constant_span = 8;  ///< its constant steps, over the usual one
    std::size_t evaluations = 6000;
    std::function<RuleRow(double target, LongRun& progress)> event_driven{};
    std::function<learn::StepEnvironment(const learn::StepEnvironmentOptions& options)> runs{};
    std::vector<Beyond> beyond{};
};

/// Results of three rules on one problem.
struct BeyondRows {
    std::string what;
    std::string description;
    std::vector<RuleRow> rows;
};

/// Shows the progress of a run, and stops it if time stands still. The published norm weighs every
/// component by itself, so that an element that begins to slip from rest has an unbounded relative
/// error, and rules that use this norm shorten their steps by decades.
class Standstill {
public:
    Standstill(LongRun& progress, std::string label)
        : progress_(&progress), label_(std::move(label))
    {
    }

    bool operator()(double done)
    {
        if (Interrupts::any()) return false;
        progress_->show(label_, done);
        if (++steps_ % standstill != 0) return true;
        given_up_ = done - before_ < 1e-3;
        before_ = done;
        return !given_up_;
    }
    [[nodiscard]] bool given_up() const { return given_up_; }

    /// A run is given up if so many steps, many times those of a whole run, cover less than a
    /// thousandth of the time.
    static constexpr int standstill = 500;

private:
    LongRun* progress_;
    std::string label_;
    int steps_ = 0;
    double before_ = 0;
    bool given_up_ = false;
};

/// Runs of rules on one problem, each with a sequence of settings.
class Ladders {
public:
    Ladders(const Case& of, const StepProblem& problem, LongRun& progress)
        : of_(of), problem_(problem), progress_(progress)
    {
    }

    [[nodiscard]] RuleRow constant() const
    {
        return coarsest("constant", [this](int i) {
            const double step = of_.constant_span * finer(i);
            return std::pair(StepRule{.controller = ConstantStep{}, .step = step},
                             fmt::format("{:.3g} s", step * problem_.usual_step));
        });
    }
    [[nodiscard]] RuleRow controlled(std::string name, const StepController& controller,
                                     ErrorEstimate estimate) const
    {
        return coarsest(std::move(name), [&, estimate](int i) {
            const double tolerance = of_.coarsest * finer(i);
            return std::pair(
                StepRule{.controller = controller, .tolerance = tolerance, .estimate = estimate},
                fmt::format("{:.1e}", tolerance));
        });
    }
    [[nodiscard]] RuleRow free_estimate() const
    {
        return controlled("free estimate", plain, ErrorEstimate::embedded);
    }
    [[nodiscard]] RuleRow learned() const
    {
        const LearnedStep rule{.policy = named_policy(of_.layout, std::nullopt), .plain = plain};
        return controlled("learned", rule, ErrorEstimate::embedded);
    }

private:
    static constexpr ErrorStep plain{.order = 3, .reject_above = 100};

    static double finer(int i) { return std::pow(10.0, -i / 6.0); }

    /// The coarsest rule of a ladder from which on the error stays below the target.
    [[nodiscard]] RuleRow coarsest(
        std::string name, const std::function<std::pair<StepRule, std::string>(int)>& rung) const
    {
        constexpr int rungs = 40;
        constexpr int enough = 4;  // number of finer settings that are tried, too
        RuleRow out{.rule = std::move(name)};
        int below = 0;
        int first = -1;
        for (int i = 0; i < rungs && below <= enough; ++i) {
            auto [rule, setting] = rung(i);
            Standstill watch(progress_, fmt::format("{}: {}, {}", of_.system, out.rule, setting));
            rule.watch = std::ref(watch);
            const StepTrial trial = problem_.run(rule);
            out.given_up += watch.given_up();
            const bool good = trial.ended && trial.error <= of_.target;
            below = good ? below + 1 : 0;
            first = !good ? -1 : first < 0 ? i : first;
        }
        if (first < 0) return out;
        const auto [rule, setting] = rung(first);
        out.setting = setting;
        out.reached = true;
        out.trial = problem_.run(rule);
        out.seconds = seconds_of([&, chosen = rule] { (void)problem_.run(chosen); }, 1);
        return out;
    }

    const Case& of_;
    const StepProblem& problem_;
    LongRun& progress_;
};

}  // namespace ricochet::app
