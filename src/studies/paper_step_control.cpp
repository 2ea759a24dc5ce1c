// D. M. Riley, A. Stathas, D. Gutierrez-Oribio and I. Stefanou, Reinforcement learning-based
// adaptive time-integration for nonsmooth dynamics: its tables and its two small systems. The
// fault is in paper_step_control_fault.cpp.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "interrupt.hpp"
#include "learn/step_environment.hpp"
#include "paper_step_control.hpp"
#include "papers.hpp"
#include "policy_lookup.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/learn_steps/policies.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "studies.hpp"

namespace ricochet::app {

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// A table of single numbers.
struct Parameter {
    std::string name;
    double ours;
    double paper;
    double off = 0;  ///< relative difference that is allowed
};

Exhibit of_parameters(const std::vector<Parameter>& parameters, std::string remark = "")
{
    Exhibit out{.columns = {"paper", "ours"}, .remark = std::move(remark)};
    for (const Parameter& p : parameters) {
        out.rows.push_back({.name = p.name, .value = {p.paper, p.ours}});
        const double off = p.off * std::fabs(p.paper);
        out.agreements.push_back({p.name, p.ours, p.paper, p.paper - off, p.paper + off});
    }
    return out;
}

Exhibit table_1(const ExhibitSize& /*size*/)
{
    const learn::TqcOptions o;
    const auto size = [](std::size_t n) { return static_cast<double>(n); };
    return of_parameters({{"actor: hidden layers", size(o.actor.size()), 2},
                          {"actor: width", size(o.actor[0]), 64},
                          {"critic: hidden layers", size(o.critic.size()), 3},
                          {"critic: width", size(o.critic[0]), 64},
                          {"critics", size(o.critics), 5},
                          {"learning rate", o.rate, 3e-4},
                          {"buffer", size(o.training.buffer), 1e6},
                          {"batch", size(o.training.batch), 256},
                          {"discount", o.training.discount, 0.99},
                          {"Polyak coefficient", o.training.polyak, 0.005},
                          {"steps until the noise is redrawn (state-dependent exploration)",
                           size(o.noise_interval), 1},
                          {"training steps (section 4.5)", size(o.training.steps), 20'000}});
}

Exhibit table_2(const ExhibitSize& /*size*/)
{
    const HeuristicStep rule;
    return of_parameters({{"integrator order p", static_cast<double>(rule.order), 1},
                          {"shortest step [s]", learn::published_step_environment().h_min, 1e-5},
                          {"increasing factor", rule.up, 2},
                          {"decreasing factor", rule.down, 0.6}});
}

Exhibit table_3(const ExhibitSize& /*size*/)
{
    const PrintedPiStep rule;
    return of_parameters({{"integrator order p", static_cast<double>(rule.order), 1},
                          {"shortest step [s]", learn::published_step_environment().h_min, 1e-5},
                          {"gamma 1", rule.gamma1, 1.0 / 6},
                          {"gamma 2", rule.gamma2, 1.0 / 6},
                          {"kappa", rule.kappa, 1.0 / 6},
                          {"c1", rule.c1, 1.8},
                          {"c2", rule.c2, 2.2}},
                         "Of PrintedPiStep, the controller as printed; the paper's code runs "
                         "another, FilteredStep::h211b(4).");
}

Exhibit table_4(const ExhibitSize& /*size*/)
{
    const StrikeSlipFault::Parameters p;
    return of_parameters(
        {{"side [km]", p.side / 1000, 3},
         {"shear modulus [GPa]", p.shear_modulus / 1e9, 30},
         {"mean effective normal stress [MPa]", p.stress_gradient * p.side / 2e6, 22.5},
         {"density [kg/m^3]", p.density, 2500},
         {"Poisson's ratio", p.poisson, 0.25},
         {"damping ratio", p.damping, 0.27, 0.02}},
        "The far-field velocity is 0 in both. The damping ratio is that of the "
        "paper's code, 0.8 / 3.");
}

Exhibit table_5(const ExhibitSize& /*size*/)
{
    const StrikeSlipFault fault;
    const StrikeSlipFault::Parameters& p = fault.parameters();
    const Rupture run = ricochet::simulate(fault, {.t_end = 30});
    return of_parameters({{"friction drop", p.friction_drop, 0.1},
                          {"residual friction", p.residual_friction, 0.5},
                          {"slip distance [mm]", p.slip_distance * 1000, 100},
                          {"largest velocity of one element [m/s]", run.peak_velocity, 0.07, 0.05}},
                         "The velocity is an estimate in the paper; ours is that of the run.");
}

/// A run of a small system: its states at the ends of the steps.
template <class System>
struct Trace {
    std::string name;
    std::vector<double> t{}, h{}, reaction{};
    std::vector<StateOf<System>> w{};
    SetValuedStatistics counts{};
    double seconds = 0;
    bool ended = false;
};

template <class System>
Trace<System> trace(std::string name, const System& system, const StateOf<System>& start,
                    const SetValuedOptions& options)
{
    check_exhibit();
    Trace<System> out{.name = std::move(name)};
    const auto run = [&](bool recorded) {
        SetValuedMotion<System> motion(system, start, options);
        const auto record = [&](const auto& state) {
            if (!recorded) return;
            if (!out.t.empty()) out.h.push_back(state.t - out.t.back());
            out.t.push_back(state.t);
            out.w.push_back(state.w);
            out.reaction.push_back(state.reaction[0]);
        };
        out.ended = motion.run(record) == Outcome::reached_end;
        out.counts = motion.statistics();
    };
    run(true);
    out.seconds = seconds_of([&] { run(false); }, 0.3);
    return out;
}

/// Options of the published scheme, with the error by step doubling.
SetValuedOptions published_scheme(double t_end, double h_max)
{
    const learn::StepEnvironmentOptions published = learn::published_step_environment();
    SetValuedOptions out{.t_end = t_end, .step = h_max / 100};
    out.estimate = ErrorEstimate::doubling;
    out.rtol = published.tolerance;
    out.atol = 1e-3 * published.tolerance;
    out.error_order = 1;
    out.h_max = h_max;
    out.scheme.first_stage = published.first_stage;
    out.max_attempts = 20'000;
    return out;
}

/// The runs that the paper trains on.
learn::StepEnvironment training_environment(const SlidingMode&, double t_end,
                                            const learn::StepEnvironmentOptions& options)
{
    return learn::step_environment(SlidingMode({.amplitude = 1.5}), 0.1, t_end, options);
}

learn::StepEnvironment training_environment(const DiodeCircuit& system, double t_end,
                                            const learn::StepEnvironmentOptions& options)
{
    return learn::step_environment(system, {0.15264, -0.02281, 0.38127}, t_end, options);
}

/// The rules of the paper and one of ours on one system.
template <class System>
std::vector<Trace<System>> traces(const System& system, const StateOf<System>& start, double t_end,
                                  double h_max, bool trained_now)
{
    const SetValuedOptions scheme = published_scheme(t_end, h_max);
    const auto by = [&](std::string name, const StepController& controller) {
        SetValuedOptions options = scheme;
        options.controller = controller;
        return trace(std::move(name), system, start, options);
    };
    std::vector<Trace<System>> out;
    out.push_back(by("PI, eq. 6 as printed", PrintedPiStep{}));
    out.push_back(by("PI as coded, h211b", FilteredStep::h211b(4)));
    out.push_back(by("heuristic, eq. 5", HeuristicStep{}));
    const auto by_actor = [&](std::string name, const Model& actor,
                              const learn::StepEnvironmentOptions& judged_as) {
        const learn::StepEnvironment runs =
            source_environment(std::string(System::name), judged_as);
        const std::vector<double> lengths = lengths_of(runs, actor);
        if (lengths.empty()) return Trace<System>{.name = std::move(name)};
        SetValuedOptions options = scheme;
        options.step = lengths.front();
        options.controller =
            PrescribedSteps{.lengths = std::make_shared<const std::vector<double>>(lengths)};
        return trace(std::move(name), system, start, options);
    };
    const Model tqc = shipped_actor(System::name);
    out.push_back(by_actor("TQC, the stored actor", tqc, judged(tqc)));
    if (trained_now) {
        learn::StepEnvironmentOptions options = learn::published_step_environment();
        options.max_attempts = 5000;
        const learn::Environment environment =
            training_environment(system, t_end, options).environment;
        const auto goes_on = [](const auto&, const Model&) { return !Interrupts::any(); };
        const Model by_tqc = learn::train_tqc(environment, {}, goes_on).policy;
        check_exhibit();
        const Model by_td3 = learn::train_td3(environment, {}, goes_on).policy;
        check_exhibit();
        out.push_back(by_actor("TQC, trained on the paper's run", by_tqc, options));
        out.push_back(by_actor("TD3, trained on the paper's run", by_td3, options));
    }
    SetValuedOptions free = scheme;
    free.estimate = ErrorEstimate::embedded;
    free.scheme.first_stage = FirstStage::averaged;
    free.controller = LearnedStep{.policy = named_policy(System::step_layout(), std::nullopt)};
    free.fields = {{.first = 0, .count = start.size(), .rtol = 1e-3, .floor = start.stableNorm()}};
    out.push_back(trace("learned factor, free estimate", system, start, free));
    return out;
}

/// Root mean square over time of the difference from `exact(t)`, straight lines between the ends of
/// the steps, and that of `exact`.
template <class System, class Exact>
std::pair<double, double> off_by(const Trace<System>& run, const Exact& exact)
{
    constexpr std::size_t samples = 5000;
    double error = 0;
    double size = 0;
    std::size_t i = 1;
    for (const double t : even(run.t.front(), run.t.back(), samples + 1)) {
        while (i + 1 < run.t.size() && run.t[i] < t) ++i;
        const double share = std::min(1.0, (t - run.t[i - 1]) / run.h[i - 1]);
        const StateOf<System> w = exact(t);
        error += (run.w[i - 1] + share * (run.w[i] - run.w[i - 1]) - w).squaredNorm();
        size += w.squaredNorm();
    }
    return {std::sqrt(error / (samples + 1)), std::sqrt(size / (samples + 1))};
}

/// Rows: work and error of each run; times over that of the slowest.
template <class System, class Error>
void add_rows(Exhibit& out, const std::vector<Trace<System>>& runs, const Error& error)
{
    double slowest = 0;
    for (const auto& run : runs) slowest = std::max(slowest, run.seconds);
    for (const auto& run : runs) {
        ExhibitRow row{.name = run.name, .value = std::vector<double>(6, none)};
        if (run.ended) {
            row.value = {static_cast<double>(run.counts.accepted),
                         static_cast<double>(run.counts.rejected + run.counts.unsolved),
                         static_cast<double>(run.counts.stages),
                         run.seconds * 1e6,
                         run.seconds / slowest,
                         error(run)};
        }
        out.rows.push_back(std::move(row));
    }
}

template <class System, class Value>
Curve curve_of(const Trace<System>& run, const Value& value)
{
    Curve out{.name = run.name, .x = run.t};
    for (std::size_t i = 0; i < run.t.size(); ++i) out.y.push_back(value(i));
    return out;
}

Agreement within(std::string what, double ours, double paper, double factor)
{
    return {std::move(what), ours, paper, paper / factor, paper * factor};
}

const ExhibitRow& row_of(const Exhibit& exhibit, std::string_view name)
{
    return *std::find_if(exhibit.rows.begin(), exhibit.rows.end(), [name](const ExhibitRow& row) {
        return !row.published && row.name.starts_with(name);
    });
}

/// The published row of a rule: steps, time and error as far as they are printed.
ExhibitRow published(std::string name, double time, double error)
{
    return {std::move(name), {none, none, none, none, time, error}, true};
}

const std::vector<std::string> columns{"steps",     "rejected",       "solves",
                                       "time [us]", "time / slowest", "error"};

Exhibit figure_2(const ExhibitSize& size)
{
    const SlidingMode system;  // the test problem: amplitude 1.75, start 0.15
    using Vector = SlidingMode::Vector;
    const double h_max = 2 * std::numbers::pi / (10 * system.parameters().frequency);
    const auto runs =
        traces(system, Vector::Constant(SlidingMode::start), SlidingMode::t_end, h_max, size.full);
    Exhibit out{.panels = {{.title = "state", .x_label = "t [s]", .y_label = "w"},
                           {.title = "controller", .x_label = "t [s]", .y_label = "F_r"}},
                .columns = columns,
                .format = "{:.3g}"};
    Curve exact{.name = "exact", .x = even(0, SlidingMode::t_end, 501)};
    for (const double t : exact.x) exact.y.push_back(system.exact(t, SlidingMode::start));
    out.panels[0].curves.push_back(std::move(exact));
    for (const auto& run : runs) {
        if (!run.ended) continue;
        out.panels[0].curves.push_back(curve_of(run, [&](std::size_t i) { return run.w[i][0]; }));
        out.panels[1].curves.push_back(
            curve_of(run, [&](std::size_t i) { return run.reaction[i]; }));
        out.panels[0].curves.back().style = out.panels[1].curves.back().style =
            Curve::Style::points;
    }
    out.rows = {published("PI", 1.0, 1.9e-4), published("heuristic", 0.90, 1.7e-4),
                published("TQC", 0.44, 2.9e-4), published("TD3", 0.43, 2.7e-4)};
    add_rows(out, runs, [&](const Trace<SlidingMode>& run) {
        return off_by(run,
                      [&](double t) -> Vector {
                          return Vector::Constant(system.exact(t, SlidingMode::start));
                      })
            .first;
    });
    out.agreements = {within("error, heuristic", row_of(out, "heuristic").value[5], 1.7e-4, 5),
                      within("error, PI as coded", row_of(out, "PI as").value[5], 1.9e-4, 5)};
    out.remark =
        "Error: root mean square over time against the solution, straight lines between "
        "steps; the paper does not say which norm its L2 is. A rule without numbers did not "
        "come to the end in 20 000 attempts.";
    return out;
}

Exhibit figure_3(const ExhibitSize& size)
{
    const DiodeCircuit system;
    using Vector = DiodeCircuit::Vector;
    const double t_end = DiodeCircuit::t_end;
    const auto runs = traces(system, DiodeCircuit::start(), t_end, t_end / 10, size.full);
    SetValuedOptions constant = published_scheme(t_end, t_end);
    constant.estimate = ErrorEstimate::none;
    constant.step = 1e-3;
    constant.max_attempts = 1'000'000;
    const Trace<DiodeCircuit> reference =
        trace("constant, 0.001 s", system, DiodeCircuit::start(), constant);
    const auto exact = [&](double t) -> Vector {
        const auto at = static_cast<std::size_t>(std::clamp(
            std::lround(t / constant.step), 0L, static_cast<long>(reference.w.size()) - 1));
        return reference.w[at];
    };
    Exhibit out{.columns = columns, .format = "{:.3g}"};
    constexpr std::array labels{"V1 [V]", "V2 [V]", "i [A]", "F_r [V/s]"};
    for (std::size_t k = 0; k < labels.size(); ++k) {
        Panel panel{.title = labels[k], .x_label = "t [s]", .y_label = labels[k]};
        const auto value = [&](const Trace<DiodeCircuit>& run, std::size_t i) {
            return k < 3 ? run.w[i][static_cast<Eigen::Index>(k)]
                         : run.reaction[i] / system.parameters().capacitance_1;
        };
        Curve fine{.name = reference.name};
        for (std::size_t i = 0; i < reference.t.size(); i += 20) {
            fine.x.push_back(reference.t[i]);
            fine.y.push_back(value(reference, i));
        }
        panel.curves.push_back(std::move(fine));
        for (const auto& run : runs) {
            if (!run.ended) continue;
            panel.curves.push_back(curve_of(run, [&](std::size_t i) { return value(run, i); }));
            panel.curves.back().style = Curve::Style::points;
        }
        out.panels.push_back(std::move(panel));
    }
    out.rows = {published("PI", 0.10, 0.0038), published("heuristic", 0.13, 0.0044),
                published("TQC", 0.01, 0.196), published("TD3", 1.0, 0.272)};
    add_rows(out, runs, [&](const Trace<DiodeCircuit>& run) {
        const auto [error, all] = off_by(run, exact);
        return error / all;
    });
    out.agreements = {within("error, heuristic", row_of(out, "heuristic").value[5], 0.0044, 3),
                      within("error, PI as coded", row_of(out, "PI as").value[5], 0.0038, 3)};
    out.remark =
        "Error: relative, root mean square over time, against the constant steps, as the paper's. "
        "The stored actor was trained on this very run, the paper's on another start; --full "
        "trains on that. A rule without numbers did not come to the end in 20 000 attempts.";
    return out;
}

}  // namespace

std::vector<double> lengths_of(const learn::StepEnvironment& runs, const Model& actor)
{
    const Mlp<double> network(actor);
    const learn::Environment& environment = runs.environment;
    std::vector<double> observation(environment.observations);
    std::vector<double> out;
    environment.reset(0, observation);
    for (;;) {
        double action = 0;
        network.forward(observation.data(), &action);
        action = std::tanh(action);
        const std::uint64_t before = runs.trial().steps;
        const learn::Reaction reaction = environment.step({&action, 1}, observation);
        if (runs.trial().steps > before) out.push_back(runs.length_of(action));
        if (reaction.terminal || reaction.truncated) break;
    }
    return runs.trial().ended ? out : std::vector<double>{};
}

Paper step_control_paper()
{
    return {.name = "step-control",
            .source =
                "D. M. Riley, A. Stathas, D. Gutierrez-Oribio and I. Stefanou, "
                "Reinforcement learning-based adaptive time-integration for nonsmooth "
                "dynamics",
            .exhibits = {
                {ExhibitKind::table, 1, "hyperparameters of TQC", table_1},
                {ExhibitKind::table, 2, "parameters of the heuristic", table_2},
                {ExhibitKind::table, 3, "parameters of the PI controller", table_3},
                {ExhibitKind::table, 4, "the fault's material and geometry", table_4},
                {ExhibitKind::table, 5, "the fault's friction and its largest velocity", table_5},
                {ExhibitKind::figure, 1, "how policy, trainer and environment act together",
                 nullptr, "a diagram of the algorithm"},
                {ExhibitKind::figure, 2, "a sliding-mode controller by several rules", figure_2},
                {ExhibitKind::figure, 3, "a diode circuit by several rules", figure_3},
                {ExhibitKind::figure, 4, "a strike-slip fault", nullptr, "a drawing of the set-up"},
                {ExhibitKind::figure, 5, "run time of the heuristic over that of learned steps",
                 fault_figure_5},
                {ExhibitKind::figure, 6, "run time of the PI controller over that of learned steps",
                 fault_figure_6},
                {ExhibitKind::figure, 7, "steps over time by three rules", fault_figure_7},
                {ExhibitKind::figure, 8, "velocity and slip by three rules", fault_figure_8},
                {ExhibitKind::figure, 9, "errors of the slip", fault_figure_9},
                {ExhibitKind::figure, 10, "the policy on finer meshes", fault_figure_10},
            }};
}

}  // namespace ricochet::app
