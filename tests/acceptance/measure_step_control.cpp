// Steps chosen by a network against classical rules, at equal true error.
#include "measure_step_control.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <thread>

#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/learn/step_control.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::bench {

namespace {

using learn::StepFamily;
using learn::StepProblem;
using learn::StepRule;
using learn::StepTrial;
using learn::WorkCurve;

const std::filesystem::path policies = RICOCHET_STEP_POLICIES;
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr int seeds = 5;

LearnedStep learned(const std::string& system, int seed)
{
    const auto file = policies / fmt::format("{}-step-{}.safetensors", system, seed);
    return {.policy = std::make_shared<const StepPolicy>(load_model(file))};
}

double median(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/// Rules from coarse to fine about an error of 1e-2: `tolerance` from 0.01 to 4e-4, or steps from
/// 0.5 to 0.06 s on 3 km.
template <class Make>
std::vector<StepRule> ladder(const Make& make)
{
    std::vector<StepRule> out;
    for (int i = 0; i <= 8; ++i) out.push_back(make(0.01 * std::pow(10.0, -i / 6.0)));
    return out;
}

std::vector<StepRule> constant()
{
    std::vector<StepRule> out;
    for (int i = 0; i <= 9; ++i) {
        out.push_back({.controller = ConstantStep{}, .step = 4 * std::pow(10.0, -i / 10.0)});
    }
    return out;
}
std::vector<StepRule> embedded(const StepController& controller)
{
    return ladder([&](double tolerance) {
        return StepRule{.controller = controller, .tolerance = tolerance};
    });
}
std::vector<StepRule> heuristic()
{
    return ladder([](double tolerance) {
        return StepRule{.controller = HeuristicStep{},
                        .tolerance = tolerance,
                        .estimate = ErrorEstimate::doubling};
    });
}

/// Work of a ladder of rules on a problem, by error; errors are averaged over 15 % of work.
struct Needs {
    WorkCurve iterations, solves, of_final;

    [[nodiscard]] double iterations_at(double error) const
    {
        return std::exp(iterations.work_at(std::log(error)));
    }
    [[nodiscard]] double solves_at(double error) const
    {
        return std::exp(solves.work_at(std::log(error)));
    }
    [[nodiscard]] double iterations_at_final(double error) const
    {
        return std::exp(of_final.work_at(std::log(error)));
    }
};

Needs needs(const StepProblem& problem, const std::vector<StepRule>& rules)
{
    std::vector<StepTrial> trials(rules.size());
    std::thread other([&] {
        for (std::size_t i = 1; i < rules.size(); i += 2) trials[i] = problem.run(rules[i]);
    });
    for (std::size_t i = 0; i < rules.size(); i += 2) trials[i] = problem.run(rules[i]);
    other.join();
    Needs out;
    for (const StepTrial& t : trials) {
        if (!t.ended) continue;
        const double of_iterations = std::log(static_cast<double>(std::max(t.iterations, 1ul)));
        out.iterations.add(of_iterations, std::log(t.error));
        out.solves.add(std::log(static_cast<double>(t.solves)), std::log(t.error));
        out.of_final.add(of_iterations, std::log(std::max(t.final_error, 1e-12)));
    }
    constexpr double share = 0.15;
    out.iterations.finish(share);
    out.solves.finish(share);
    out.of_final.finish(share);
    return out;
}

struct Mesh {
    int elements;
    double side;   ///< [m]
    double t_end;  ///< [s]
};

/// Gains of the policies of all seeds on one fault.
struct Gains {
    double over_classical = 0;  ///< the best rule that examines errors
    double over_heuristic = 0;
    double over_constant = 0;
    double over_best = 0;      ///< constant steps or a rule
    double final_slip = 0;     ///< over the best of all, at 1e-3
    double solves_to_end = 0;  ///< relative to constant steps that continue when all is at rest
    std::string line;
};

Gains gains_on(const Mesh& mesh)
{
    const double target = 1e-2;
    const StepProblem problem = learn::fault_problem(
        StrikeSlipFault({.elements = mesh.elements, .side = mesh.side}), mesh.t_end);
    const Needs of_constant = needs(problem, constant());
    std::vector<Needs> rules;
    for (const double reject_above : {100.0, inf}) {
        rules.push_back(
            needs(problem, embedded(ErrorStep{.order = 3, .reject_above = reject_above})));
    }
    if (mesh.elements == 10) {  // far behind there
        FilteredStep filter = FilteredStep::h211b(4);
        filter.order = 2;
        rules.push_back(needs(problem, embedded(filter)));
        rules.push_back(needs(problem, embedded(ErrorStep{.order = 3, .reject_above = 1})));
    }
    const Needs of_heuristic = needs(problem, heuristic());
    double classical = inf;
    double final_slip = of_constant.iterations_at_final(1e-3);
    for (const Needs& rule : rules) {
        classical = std::min(classical, rule.iterations_at(target));
        final_slip = std::min(final_slip, rule.iterations_at_final(1e-3));
    }
    std::vector<double> iterations, solves, slips;
    for (int seed = 1; seed <= seeds; ++seed) {
        const Needs of_policy = needs(problem, embedded(learned("fault", seed)));
        iterations.push_back(of_policy.iterations_at(target));
        solves.push_back(of_policy.solves_at(target));
        slips.push_back(of_policy.iterations_at_final(1e-3));
    }
    const double mine = median(iterations);
    const double constant_iterations = of_constant.iterations_at(target);
    const StepTrial at_rest = problem.run({.controller = ConstantStep{}, .step = 1});
    // One step is 0.125 s of 3 km; the part omitted after rest is known from that run.
    const double unit = 0.125 * mesh.side / 3000;
    const double whole = mesh.t_end / (static_cast<double>(at_rest.steps) * unit);
    Gains out{.over_classical = classical / mine,
              .over_heuristic = of_heuristic.iterations_at(target) / mine,
              .over_constant = constant_iterations / mine,
              .over_best = std::min(classical, constant_iterations) / mine,
              .final_slip = final_slip / median(slips),
              .solves_to_end = of_constant.solves_at(target) * whole / median(solves),
              .line = {}};
    out.line = fmt::format(
        "{0:>3} x {0:<3} {1:.0f} km: constant {2:.0f} iterations, eq. 5 {3:.0f}, best rule "
        "{4:.0f}, "
        "policies {5:.0f} ({6:.0f} to {7:.0f}); solves {8:.0f}, constant {9:.0f}; slip to 1e-3: "
        "best classical {10:.0f}, policies {11:.0f} ({12:.0f} to {13:.0f})",
        mesh.elements, mesh.side / 1000, constant_iterations, of_heuristic.iterations_at(target),
        classical, mine, *std::min_element(iterations.begin(), iterations.end()),
        *std::max_element(iterations.begin(), iterations.end()), median(solves),
        of_constant.solves_at(target), final_slip, median(slips),
        *std::min_element(slips.begin(), slips.end()),
        *std::max_element(slips.begin(), slips.end()));
    return out;
}

const std::vector<std::pair<Mesh, Gains>>& all_gains()
{
    static const auto gains = [] {
        std::vector<std::pair<Mesh, Gains>> out;
        for (const Mesh& mesh : {Mesh{10, 3000, 30}, Mesh{25, 3000, 30}, Mesh{50, 3000, 30},
                                 Mesh{10, 5000, 50}, Mesh{25, 5000, 50}, Mesh{50, 5000, 50}}) {
            out.emplace_back(mesh, gains_on(mesh));
        }
        return out;
    }();
    return gains;
}

/// The least of a gain over the meshes of that side, or of all.
double least(double Gains::*member, double side = 0)
{
    double out = inf;
    for (const auto& [mesh, gains] : all_gains()) {
        if (side == 0 || mesh.side == side) out = std::min(out, gains.*member);
    }
    return out;
}

std::string by_mesh(double Gains::*member)
{
    std::string out;
    for (const auto& [mesh, gains] : all_gains()) {
        out += fmt::format("{}{:.2f}", out.empty() ? "" : ", ", gains.*member);
    }
    return out;
}

Measured on_meshes(double Gains::*member, double target)
{
    return {.pass = least(member) >= target, .text = by_mesh(member)};
}

/// The mean gain of every seed on a family held out, by tolerance.
struct OnFamily {
    double gain = 0;
    double final_gain = 0;
};

OnFamily on_family(const StepFamily& family, const std::string& system, int count, Measured& out)
{
    const learn::StepScore score(family, 2);
    std::vector<double> gains, finals;
    for (int seed = 1; seed <= count; ++seed) {
        double sum = 0;
        double of_final = 0;
        std::string line = fmt::format("seed {}:", seed);
        const auto parts = score.parts(learned(system, seed));
        for (const auto& part : parts) {
            sum += part.gain;
            of_final += part.final_gain;
            line += fmt::format(" {:.2f}", std::exp(part.gain));
        }
        const auto n = static_cast<double>(parts.size());
        gains.push_back(std::exp(sum / n));
        finals.push_back(std::exp(of_final / n));
        out.details.push_back(line);
    }
    return {median(gains), median(finals)};
}

}  // namespace

Measured gain_over_classical_rules()
{
    Measured out = on_meshes(&Gains::over_classical, 1.3);
    for (const auto& [mesh, gains] : all_gains()) out.details.push_back(gains.line);
    return out;
}

Measured gain_over_heuristic()
{
    return on_meshes(&Gains::over_heuristic, 2);
}

Measured gain_over_constant_steps()
{
    Measured out;
    out.pass = least(&Gains::over_constant, 3000) >= 1.5 && least(&Gains::over_constant, 5000) >= 2;
    out.text = by_mesh(&Gains::over_constant);
    out.details.push_back(fmt::format(
        "constant steps end when all is at rest; if they go on to 30 and 50 s, in solves: {}",
        by_mesh(&Gains::solves_to_end)));
    out.details.push_back(
        fmt::format("over the best of constant steps and rules: {}", by_mesh(&Gains::over_best)));
    return out;
}

Measured final_slip_of_policies()
{
    return on_meshes(&Gains::final_slip, 1);
}

Measured gain_on_held_out_faults()
{
    Measured out;
    const OnFamily gain = on_family(learn::fault_family({.seed = 1'000'099}), "fault", seeds, out);
    out.pass = gain.gain >= 1;
    out.text = fmt::format("{:.2f}, at the final slip {:.2f}", gain.gain, gain.final_gain);
    out.details.push_back("1 x 1, 2 x 2, 3 x 3, each at tolerances 2e-2, 3e-3, 5e-4");
    return out;
}

Measured gain_on_sliding_mode()
{
    Measured out;
    const OnFamily gain =
        on_family(learn::sliding_mode_family(1'000'099, 64), "sliding-mode", seeds, out);
    out.pass = gain.gain >= 1.25;
    out.text = fmt::format("{:.2f}", gain.gain);
    return out;
}

Measured gain_on_diode_circuit()
{
    Measured out;
    const OnFamily gain =
        on_family(learn::diode_circuit_family(1'000'099, 64), "diode-circuit", 1, out);
    out.pass = gain.gain >= 0.95;
    out.text = fmt::format("{:.2f}", gain.gain);
    return out;
}

Measured time_of_training()
{
    const auto start = std::clock();
    const auto trained = learn::train_step_policy(learn::fault_family(), {});
    // Two threads share the work: processor time is halved, independently of other loads.
    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / 2;
    const Model shipped = load_model(policies / "fault-step-1.safetensors");
    const bool same = shipped.layers.front().weight == trained.model.layers.front().weight;
    return {.pass = seconds <= 180,
            .text = fmt::format("{:.0f} s of two cores, {} evaluations, score {:.4f}; the stored "
                                "weights {}",
                                seconds, trained.search.evaluations, trained.search.score,
                                same ? "to the bit" : "are others")};
}

}  // namespace ricochet::bench
