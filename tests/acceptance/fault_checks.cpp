// Acceptance checks of the fault and the rules for its steps: order 4 through arrests, onsets,
// energy, runs that can be watched, policies where they were not trained.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "fault_energy.hpp"
#include "measure.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/learn/step_control.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::bench {

namespace {

constexpr double constant_steps = std::numeric_limits<double>::infinity();

/// Friction with which every element is braked to rest.
FaultFriction weakening(double overload)
{
    FaultFriction out{.overload = overload};
    out.law = {.a = 0.006, .b = 0.024, .f_star = 0.6, .v_star = 1e-6, .d_rs = 0.006};
    return out;
}

Measured go_on_after_earthquakes()
{
    const StrikeSlipFault fault({.elements = 4});
    Measured out{.pass = true, .text = {}};
    for (const double overload : {1e-5, 1e-3, 1e-2, 0.05, 0.1}) {
        const RateStateRupture r =
            simulate(fault, {.t_end = 1e9, .rtol = 1e-3, .max_steps = 20'000}, weakening(overload),
                     {.order = 4});
        out.pass = out.pass && r.rupture.outcome == Outcome::reached_end && r.unsolved == 0;
        out.text +=
            fmt::format("{}{} steps", out.text.empty() ? "" : ", ", r.rupture.statistics.steps);
        out.details.push_back(
            fmt::format("overload {}: {}, {} earthquakes, {} steps of which {} handed over",
                        overload, name(r.rupture.outcome), r.earthquakes.size(),
                        r.rupture.statistics.steps, r.handed_over));
    }
    return out;
}

/// 150 faults of up to 5 x 5 elements, all laws, from creep to an overload of a tenth.
Measured go_on_with_any_friction()
{
    int ended[2] = {0, 0};
    std::uint64_t steps[2] = {0, 0};
    constexpr int faults = 150;
    for (int seed = 0; seed < faults; ++seed) {
        std::mt19937_64 engine(static_cast<std::uint64_t>(seed));
        const auto uniform = [&engine] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
        const int n = 1 + static_cast<int>(uniform() * 5);
        FaultFriction f;
        f.law.a = 0.004 * std::pow(5, uniform());
        f.law.b = f.law.a * 1.2 * std::pow(5, uniform());
        f.law.d_rs = 0.002 * std::pow(25, uniform());
        f.overload = std::pow(10, -4 + 3 * uniform());
        const double law = uniform();
        f.evolution = law < 0.6   ? StateEvolution::ageing
                      : law < 0.8 ? StateEvolution::slip
                                  : StateEvolution::prz;
        if (uniform() < 0.3) f.normal_stress = 20e6;
        const StrikeSlipFault fault({.elements = n, .damping = uniform() < 0.8 ? 0.8 / 3 : 0.05});
        for (const int order : {2, 4}) {
            const RateStateRupture r = simulate(
                fault, {.t_end = 3e8, .rtol = 1e-3, .max_steps = 60'000}, f, {.order = order});
            ended[order / 4] += r.rupture.outcome == Outcome::reached_end;
            steps[order / 4] += r.rupture.statistics.steps;
        }
    }
    return {.pass = ended[1] == faults,
            .text = fmt::format("order 4: {} of {} reach the end, {} steps; order 2: {}, {} steps",
                                ended[1], faults, steps[1], ended[0], steps[0])};
}

Measured time_onsets()
{
    const StrikeSlipFault fault({.elements = 4});
    const auto onset = [&](double rtol, int order) {
        const RateStateRupture r =
            simulate(fault, {.t_end = 4.0333e6, .rtol = rtol}, weakening(1e-3), {.order = order});
        return r.earthquakes.empty() ? 0 : r.earthquakes.front().start;
    };
    const double exact = onset(1e-6, 4);
    const double usual = std::abs(onset(1e-3, RateStateOptions{}.order) - exact);
    return {.pass = usual <= 1e-4 * exact,
            .text = fmt::format("{:.0f} s of {:.0f} s by default, {:.0f} s with order 2", usual,
                                exact, std::abs(onset(1e-3, 2) - exact))};
}

Measured balance_energy()
{
    using namespace test;
    const StrikeSlipFault fault({.elements = 5});
    constexpr double bound = 1e-8;
    const auto explicit_steps = [&](double t_end, double h) {
        return explicit_energy(
                   fault,
                   {.t_end = t_end, .step = h, .rtol = constant_steps, .polynomial_bound = bound},
                   4000)
            .defect();
    };
    const auto bathe = [&](FirstStage first, double h) {
        return bathe_energy(fault, {.t_end = 30, .step = h, .polynomial_bound = bound},
                            {.first_stage = first})
            .defect();
    };
    const StrikeSlipFault small({.elements = 4});
    const auto rate_state = [&](int order) {
        return rate_state_energy(small, {.t_end = 1e7, .rtol = 1e-3, .polynomial_bound = bound},
                                 weakening(1e-3), {.order = order})
            .defect();
    };
    const double before[2] = {explicit_steps(8, 0.2), explicit_steps(8, 0.1)};
    const double after[2] = {explicit_steps(30, 0.2), explicit_steps(30, 0.05)};
    const double second[2] = {bathe(FirstStage::averaged, 0.2), bathe(FirstStage::averaged, 0.05)};
    const double first[2] = {bathe(FirstStage::at_end, 0.2), bathe(FirstStage::at_end, 0.05)};
    const double cycle[2] = {rate_state(2), rate_state(4)};
    return {
        .pass = before[0] > 20 * before[1] && after[0] > 8 * after[1] &&
                second[0] > 12 * second[1] && first[0] > 3.5 * first[1] &&
                std::max(cycle[0], cycle[1]) < 1e-3,
        .text = fmt::format("explicit 0.2 s {:.0e} before arrests, {:.0e} at rest; Bathe {:.0e}; "
                            "published {:.0e}; rate-and-state {:.0e}, {:.0e}",
                            before[0], after[0], second[0], first[0], cycle[0], cycle[1]),
        .details = {fmt::format("half the step: {:.0e} before arrests; a quarter: {:.0e}, {:.0e}, "
                                "{:.0e}",
                                before[1], after[1], second[1], first[1])}};
}

/// The longest time between two calls of the watcher of the comparison's runs.
Measured watch_long_runs()
{
    using Clock = std::chrono::steady_clock;
    Clock::time_point last = Clock::now();
    double longest = 0;
    const learn::StepWatch watch = [&](double) {
        const Clock::time_point now = Clock::now();
        longest = std::max(longest, std::chrono::duration<double>(now - last).count());
        last = now;
        return true;
    };
    const Clock::time_point start = last;
    const StrikeSlipFault fault({.elements = 7, .residual_friction = 0.3, .friction_drop = 0.4});
    const learn::StepProblem problem = learn::fault_problem(fault, 30, 0, watch);
    for (const double tolerance : {1e-1, 1e-2, 4.6e-3, 1e-3}) {
        (void)problem.run({.controller = FilteredStep::pi3333(),
                           .tolerance = tolerance,
                           .estimate = ErrorEstimate::doubling,
                           .watch = watch});
    }
    (void)learn::search_steps(problem, 70, 100, 1, 2, watch);
    const double all = std::chrono::duration<double>(Clock::now() - start).count();
    return {
        .pass = longest <= 2,
        .text = fmt::format("{:.2f} s of {:.1f} s are the longest without a sign", longest, all)};
}

/// Iterations of the coarsest setting from which the error stays below 1e-2.
std::uint64_t iterations(const learn::StepProblem& problem,
                         const std::function<learn::StepRule(double finer)>& rule)
{
    std::uint64_t first = 0;
    int below = 0;
    for (int i = 0; i < 40 && below <= 4; ++i) {
        const learn::StepTrial trial = problem.run(rule(std::pow(10.0, -i / 6.0)));
        const bool good = trial.ended && trial.error <= 1e-2;
        if (good && below == 0) first = trial.iterations;
        below = good ? below + 1 : 0;
    }
    return below > 4 ? first : 0;
}

Measured leave_the_family()
{
    const auto policy =
        std::make_shared<const StepPolicy>(load_model(RICOCHET_MODELS "/fault-step.safetensors"));
    constexpr ErrorStep plain{.order = 3, .reject_above = 100};
    Measured out{.pass = true, .text = {}};
    const auto row = [&](const std::string& what, StrikeSlipFault::Parameters p) {
        p.elements = 5;
        const StrikeSlipFault fault(p);
        const learn::StepProblem problem =
            learn::fault_problem(fault, 30 / 0.8660254037844386 * fault.time_unit());
        const auto constant = iterations(problem, [](double finer) {
            return learn::StepRule{.controller = ConstantStep{}, .step = 8 * finer};
        });
        const auto free = iterations(problem, [&](double finer) {
            return learn::StepRule{.controller = plain, .tolerance = 0.1 * finer};
        });
        const auto learned = iterations(problem, [&](double finer) {
            return learn::StepRule{.controller = LearnedStep{.policy = policy, .plain = plain},
                                   .tolerance = 0.1 * finer};
        });
        out.pass = out.pass && constant > 0 && free > 0 && learned > 0;
        out.text += fmt::format("{}{}: {}, {}, {}", out.text.empty() ? "" : "; ", what, constant,
                                free, learned);
    };
    row("default", {});
    row("damping 0.05", {.damping = 0.05});
    row("damping 0.8", {.damping = 0.8});
    row("12 km", {.side = 12000});
    row("overload 1e-2", {.overload = 1e-2});
    return out;
}

}  // namespace

std::vector<Check> fault_checks()
{
    return {
        {.topic = "fault",
         .id = "fault-order-4",
         .sentence = "4 x 4 elements, a = 0.006, b = 0.024, D_RS = 6 mm, order 4, five overloads",
         .target = "the end is reached, every stage solved",
         .run = go_on_after_earthquakes},
        {.topic = "fault",
         .id = "fault-any-friction",
         .sentence = "150 random faults with rate-and-state friction, order 4",
         .target = "all reach the end",
         .run = go_on_with_any_friction},
        {.topic = "fault",
         .id = "fault-onset",
         .sentence = "time of the first onset by default against rtol 1e-6",
         .target = "within 1e-4 (was 1956 s of 4.03e6 s)",
         .run = time_onsets},
        {.topic = "fault",
         .id = "fault-energy",
         .sentence = "work of the load = motion + strain + friction + radiation",
         .target = "to the order of the steps; 1e-3 through an earthquake",
         .run = balance_energy},
        {.topic = "steps",
         .id = "step-control-watched",
         .sentence = "comparing steps on 7 x 7 elements, drop 0.4, residual 0.3: silence",
         .target = "at most 2 s (was 100 s)",
         .run = watch_long_runs},
        {.topic = "steps",
         .id = "step-control-beyond",
         .sentence = "iterations for an error of 1e-2: constant, free estimate, learned",
         .target = "shown",
         .run = leave_the_family},
    };
}

}  // namespace ricochet::bench
