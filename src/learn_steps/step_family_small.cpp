#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "ricochet/base/random.hpp"
#include "ricochet/learn_steps/step_control.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "step_reference.hpp"

namespace ricochet::learn {

namespace {

constexpr double usual_small_step = 0.1;  // over the system's unit of time

using detail::Reference;
using detail::samples;
using detail::Samples;

template <class System>
struct SmallProblem {
    System system;
    StateOf<System> start;
    double t_end = 1;
    Reference<System> reference;
    double of_all = 0;  ///< sum of its squares

    [[nodiscard]] SetValuedOptions options(const StepRule& rule) const
    {
        const bool constant = std::holds_alternative<ConstantStep>(rule.controller);
        SetValuedOptions out{
            .t_end = t_end,
            .step = std::min(first_step(rule, usual_small_step * system.step_unit()), t_end),
            .controller = rule.controller,
            .estimate = constant ? ErrorEstimate::none : rule.estimate,
            .fields = {{.first = 0,
                        .count = start.size(),
                        .rtol = rule.tolerance,
                        .floor = start.norm()}},
            .max_attempts = constant ? 50'000U : 5'000U};
        if (rule.estimate == ErrorEstimate::doubling) {
            // As in the published code: components are separate, and its error is of order 1.
            out.fields.clear();
            out.rtol = std::min(rule.tolerance, 0.5);
            out.atol = 1e-3 * rule.tolerance;
            out.error_order = 1;
        }
        out.scheme.first_stage = FirstStage::switch_aware;
        return out;
    }

    [[nodiscard]] StepTrial run(const StepRule& rule) const
    {
        const SetValuedOptions set = options(rule);
        SetValuedMotion<System> motion(system, start, set);
        Samples<System> at(t_end, set.estimate);
        double sum = 0;
        while (motion.outcome() == Outcome::running) {
            const Outcome outcome = motion.advance();
            if (outcome != Outcome::running && outcome != Outcome::reached_end) {
                break;
            }
            at.step(motion, [&](std::size_t i, const StateOf<System>& w) {
                sum += (w - reference[i]).squaredNorm();
            });
            if (rule.watch && !rule.watch(motion.state().t / t_end)) break;
        }
        const SetValuedStatistics& s = motion.statistics();
        StepTrial out{.ended = motion.outcome() == Outcome::reached_end,
                      .work = static_cast<double>(s.stages),
                      .steps = s.accepted,
                      .rejected = s.rejected + s.unsolved,
                      .solves = s.stages,
                      .iterations = s.iterations};
        if (const auto* learned = std::get_if<LearnedStep>(&motion.controller())) {
            out.asked = learned->asked;
            out.handed_over = learned->handed_over;
        }
        if (out.ended) {
            out.error = std::sqrt(sum / of_all);
            out.final_error = (motion.state().w - reference.back()).norm() / start.norm();
        }
        return out;
    }
};

template <class System>
StepProblem as_problem(SmallProblem<System> problem, int group)
{
    for (const auto& w : problem.reference) problem.of_all += w.squaredNorm();
    auto shared = std::make_shared<const SmallProblem<System>>(std::move(problem));
    return {.description = fmt::format("{} until {:.4g} s", System::name, shared->t_end),
            .group = group,
            .usual_step = usual_small_step * shared->system.step_unit(),
            .run = [shared](const StepRule& rule) { return shared->run(rule); }};
}

/// The value times a random factor between 1 / `factor` and `factor`.
double about(double value, double factor, Random& random)
{
    return random.log_uniform(value / factor, value * factor);
}

}  // namespace

StepProblem sliding_mode_problem(const SlidingMode& system, double from, double t_end)
{
    SmallProblem<SlidingMode> problem{.system = system,
                                      .start = SlidingMode::Vector::Constant(from),
                                      .t_end = t_end,
                                      .reference = detail::reference_of(system, from, t_end)};
    return as_problem(std::move(problem), 1);
}

StepProblem diode_circuit_problem(const DiodeCircuit& system, const Eigen::Vector3d& start,
                                  double t_end)
{
    SmallProblem<DiodeCircuit> problem{.system = system,
                                       .start = start,
                                       .t_end = t_end,
                                       .reference = detail::reference_of(system, start, t_end)};
    return as_problem(std::move(problem), 1);
}

StepFamily sliding_mode_family(std::uint64_t seed, int count)
{
    Random random(seed);
    StepFamily out{.layout = SlidingMode::step_layout(),
                   .problems = {},
                   .tolerances = {3e-3, 4e-4, 5e-5, 6e-6}};
    for (int i = 0; i < count; ++i) {
        SlidingMode::Parameters p;
        p.gain = about(p.gain, 2, random);
        p.amplitude = random.uniform(0.4, 0.95) * p.gain;
        p.frequency = about(p.frequency, 2, random);
        const double from = about(SlidingMode::start, 2, random);
        const SlidingMode system(p);
        const double t_end = system.reaching_time(from) / random.uniform(0.15, 0.7);
        out.problems.push_back(sliding_mode_problem(system, from, t_end));
    }
    return out;
}

StepFamily diode_circuit_family(std::uint64_t seed, int count)
{
    Random random(seed);
    StepFamily out{.layout = DiodeCircuit::step_layout(),
                   .problems = {},
                   .tolerances = {1e-2, 2e-3, 4e-4, 8e-5}};
    for (int i = 0; i < count; ++i) {
        DiodeCircuit::Parameters p;
        for (double* value :
             {&p.capacitance_1, &p.capacitance_2, &p.resistance, &p.inductance, &p.current}) {
            *value = about(*value, 1.5, random);
        }
        Eigen::Vector3d start = DiodeCircuit::start();
        for (double& w : start) w = about(std::abs(w), 2, random) * (random.chance(0.5) ? 1 : -1);
        out.problems.push_back(
            diode_circuit_problem(DiodeCircuit(p), start, random.uniform(10, 20)));
    }
    return out;
}

}  // namespace ricochet::learn
