#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "ricochet/learn/random.hpp"
#include "ricochet/learn/step_control.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::learn {

namespace {

constexpr std::size_t samples = 2000;
constexpr double usual_step = 0.1;  // over the system's unit of time

/// States at even times, the start among them.
template <class System>
using Reference = std::vector<StateOf<System>>;

/// Walks the even times that a step covers; the state there is on the parabola of the step.
template <class System>
class Samples {
public:
    Samples(double t_end, const StateOf<System>& start)
        : spacing_(t_end / static_cast<double>(samples)), last_(start)
    {
    }

    template <class Use>
    void step(const SetValuedMotion<System>& motion, const Use& use)
    {
        const auto& a = motion.before();
        const auto& c = motion.state();
        const double h = c.t - a.t;
        for (; next_ <= samples; ++next_) {
            const double theta = (static_cast<double>(next_) * spacing_ - a.t) / h;
            if (theta > 1 + 1e-12) break;
            const double wa = (2 * theta - 1) * (theta - 1);
            const double wb = 4 * theta * (1 - theta);
            const double wc = theta * (2 * theta - 1);
            last_ = wa * a.w + wb * motion.middle().w + wc * c.w;
            use(next_, last_);
        }
    }

private:
    double spacing_;
    std::size_t next_ = 1;
    StateOf<System> last_;
};

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
            .step = std::min(first_step(rule, usual_step * system.step_unit()), t_end),
            .controller = rule.controller,
            .estimate = constant ? ErrorEstimate::none : rule.estimate,
            .fields = {{.first = 0,
                        .count = start.size(),
                        .rtol = rule.tolerance,
                        .floor = start.norm()}},
            .max_attempts = constant ? 50'000U : 5'000U};
        if (rule.estimate == ErrorEstimate::doubling) {
            // As the published code: components by themselves, its error of order 1.
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
        SetValuedMotion<System> motion(system, start, options(rule));
        Samples<System> at(t_end, start);
        double sum = 0;
        while (motion.outcome() == SetValuedOutcome::running) {
            const SetValuedOutcome outcome = motion.advance();
            if (outcome != SetValuedOutcome::running && outcome != SetValuedOutcome::reached_end) {
                break;
            }
            at.step(motion, [&](std::size_t i, const StateOf<System>& w) {
                sum += (w - reference[i]).squaredNorm();
            });
        }
        const SetValuedStatistics& s = motion.statistics();
        StepTrial out{.ended = motion.outcome() == SetValuedOutcome::reached_end,
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
            .usual_step = usual_step * shared->system.step_unit(),
            .run = [shared](const StepRule& rule) { return shared->run(rule); }};
}

/// Up and down by at most this factor.
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
                                      .reference = {}};
    for (std::size_t i = 0; i <= samples; ++i) {
        const double t = t_end * static_cast<double>(i) / static_cast<double>(samples);
        problem.reference.push_back(SlidingMode::Vector::Constant(system.exact(t, from)));
    }
    return as_problem(std::move(problem), 1);
}

StepProblem diode_circuit_problem(const DiodeCircuit& system, const Eigen::Vector3d& start,
                                  double t_end)
{
    SmallProblem<DiodeCircuit> problem{
        .system = system, .start = start, .t_end = t_end, .reference = {start}};
    // Of order 2 with its switches located: off by about a millionth.
    SetValuedMotion<DiodeCircuit> motion(
        system, start,
        {.t_end = t_end, .step = 5e-4 * system.step_unit(), .switches = Switches::located});
    Samples<DiodeCircuit> at(t_end, start);
    while (motion.outcome() == SetValuedOutcome::running) {
        (void)motion.advance();
        at.step(motion,
                [&](std::size_t, const Eigen::Vector3d& w) { problem.reference.push_back(w); });
    }
    if (motion.outcome() != SetValuedOutcome::reached_end ||
        problem.reference.size() != samples + 1) {
        throw std::runtime_error(fmt::format("the reference of a diode circuit ended early: {}",
                                             describe(motion.outcome())));
    }
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
