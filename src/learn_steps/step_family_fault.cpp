#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

#include "ricochet/base/random.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/learn_steps/step_control.hpp"
#include "step_reference.hpp"

namespace ricochet::learn {

namespace {

constexpr double usual_fault_step = 0.125 / 0.8660254037844386;  // [time units]: 0.125 s at 3 km

using detail::Comparison;
using detail::FaultReference;

/// A fault, its reference, and data that runs keep for the next ones.
class FaultProblem {
public:
    FaultProblem(const StrikeSlipFault& fault, double t_end, double polynomial_bound,
                 const StepWatch& watch)
        : fault_(fault),
          t_end_(t_end),
          bound_(polynomial_bound),
          reference_(detail::reference_of(fault, t_end, polynomial_bound, watch))
    {
    }

    StepTrial run(const StepRule& rule)
    {
        std::unique_ptr<BatheRuns> runs = take();
        Comparison comparison(reference_, t_end_ / fault_.time_unit());
        const bool doubling = rule.estimate == ErrorEstimate::doubling;
        const bool constant = std::holds_alternative<ConstantStep>(rule.controller);
        RuptureOptions options{.t_end = t_end_,
                               .step = first_step(rule, usual_fault_step * fault_.time_unit()),
                               .max_steps = 4000};
        if (rule.watch) options.progress = [&](double t) { return rule.watch(t / t_end_); };
        const Rupture r = runs->simulate(
            options, {.controller = rule.controller,
                      .estimate = constant ? ErrorEstimate::none : rule.estimate,
                      .norm = doubling ? FaultNorm::components : FaultNorm::fields,
                      .rtol = rule.tolerance,
                      .atol = 1e-3 * rule.tolerance,
                      .h_max = constant ? t_end_ : 0,
                      .observer = [&](const BatheStep& step) { comparison.look(step); }});
        give_back(std::move(runs));
        const RuptureStatistics& s = r.statistics;
        StepTrial out{.ended = r.outcome == Outcome::reached_end || r.outcome == Outcome::at_rest,
                      .work = static_cast<double>(s.iterations),
                      .steps = s.steps,
                      .rejected = s.rejected,
                      .solves = s.solves,
                      .iterations = s.iterations,
                      .asked = s.asked,
                      .handed_over = s.handed_over};
        if (out.ended) {
            out.error = comparison.error();
            out.final_error = std::abs(r.mean_slip / reference_.mean_slip - 1);
        }
        return out;
    }

private:
    std::unique_ptr<BatheRuns> take()
    {
        {
            const std::lock_guard lock(mutex_);
            if (!idle_.empty()) {
                auto out = std::move(idle_.back());
                idle_.pop_back();
                return out;
            }
        }
        return std::make_unique<BatheRuns>(fault_, bound_);
    }
    void give_back(std::unique_ptr<BatheRuns> runs)
    {
        const std::lock_guard lock(mutex_);
        idle_.push_back(std::move(runs));
    }

    StrikeSlipFault fault_;
    double t_end_;
    double bound_;
    FaultReference reference_;
    std::mutex mutex_;
    std::vector<std::unique_ptr<BatheRuns>> idle_;
};

/// For a fault that ruptures, a time that contains the whole rupture.
std::optional<double> time_of_rupture(const StrikeSlipFault& fault, double after)
{
    const Rupture run = simulate(fault, {.t_end = 80, .rtol = 1e-3, .polynomial_bound = 1e-3});
    const bool ruptures = run.peak_velocity > 0.02 * fault.velocity_unit();
    if (!ruptures || !(run.arrest_time < 60)) return std::nullopt;
    return run.arrest_time * after;
}

}  // namespace

StepProblem fault_problem(const StrikeSlipFault& fault, double t_end, double polynomial_bound,
                          const StepWatch& watch)
{
    auto problem = std::make_shared<FaultProblem>(fault, t_end, polynomial_bound, watch);
    return {.description = fmt::format("fault of {0} x {0} elements, side {1:.0f} m",
                                       fault.elements(), fault.parameters().side),
            .group = fault.elements(),
            .usual_step = usual_fault_step * fault.time_unit(),
            .run = [problem](const StepRule& rule) { return problem->run(rule); }};
}

StepFamily fault_family(const FaultFamilyOptions& options)
{
    Random random(options.seed);
    StepFamily out{.layout = fault_step_layout(),
                   .judges_final = true,
                   .problems = {},
                   .tolerances = {2e-2, 3e-3, 5e-4}};
    for (std::size_t k = 0; k < options.counts.size(); ++k) {
        for (int left = options.counts[k]; left > 0;) {
            const StrikeSlipFault fault({.elements = static_cast<int>(k) + 1,
                                         .side = random.log_uniform(2000, 6000),
                                         .damping = random.uniform(0.15, 0.45),
                                         .friction_drop = random.log_uniform(0.05, 0.2),
                                         .slip_distance = random.log_uniform(0.05, 0.2),
                                         .overload = random.log_uniform(1e-6, 1e-4)});
            const double after = random.uniform(1.2, 2.2);
            const auto t_end = time_of_rupture(fault, after);
            if (!t_end) continue;
            out.problems.push_back(fault_problem(fault, *t_end));
            --left;
        }
    }
    return out;
}

}  // namespace ricochet::learn
