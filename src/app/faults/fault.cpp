#include "fault.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "files.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "json_text.hpp"
#include "plot.hpp"
#include "policy_lookup.hpp"
#include "report.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "run_watch.hpp"
#include "simulate.hpp"
#include "step_progress.hpp"

namespace ricochet::app {

namespace {

void refuse_what_is_not_for_faults(const RunRequest& run)
{
    const std::pair<bool, std::string_view> options[] = {
        {run.mode.has_value(), "--mode"},
        {run.detector.has_value(), "--detector"},
        {run.locator.has_value(), "--locator"},
        {run.stepper.has_value(), "--stepper"},
        {run.gate.has_value(), "--gate"},
        {run.atol.has_value(), "--atol"},
        {run.event_tolerance.has_value(), "--event-tolerance"}};
    for (const auto& [given, option] : options) {
        if (given) throw BadInput(fmt::format("{} is not for the system fault", option));
    }
    if (run.model && run.controller != "learned") {
        throw BadInput("--model of fault is for --controller learned");
    }
    if (run.t_start.value_or(0) != 0) {
        throw BadInput(fmt::format("a fault starts at 0 s, got --t-start {}", *run.t_start));
    }
}

/// Integrators of the rupture, by name.
struct Integration {
    std::string integrator = "explicit";
    std::string controller = "constant";
    BatheOptions bathe{};  ///< unless explicit
};

Integration integration(const RunRequest& run)
{
    Integration out;
    const std::vector<std::string_view> integrators{"explicit", "bathe", "bathe-published"};
    const std::vector<std::string_view> controllers{"constant", "error",  "heuristic",
                                                    "pi",       "filter", "learned"};
    out.integrator = run.integrator.value_or(out.integrator);
    out.controller = run.controller.value_or(out.controller);
    const auto known = [](const auto& all, const std::string& name) {
        return std::find(all.begin(), all.end(), name) != all.end();
    };
    if (!known(integrators, out.integrator)) {
        throw unknown("integrator of fault", out.integrator, integrators);
    }
    if (!known(controllers, out.controller)) {
        throw unknown("controller", out.controller, controllers);
    }
    if (out.integrator == "explicit") {
        if (run.controller)
            throw BadInput("--controller is for --integrator bathe and bathe-published");
        return out;
    }
    if (out.integrator == "bathe-published") out.bathe.first_stage = FirstStage::at_end;
    if (out.controller == "constant") {
        if (run.rtol) throw BadInput("--rtol needs a --controller that uses errors");
        return out;
    }
    if (run.rtol) out.bathe.rtol = *run.rtol;
    if (out.controller == "error" || out.controller == "learned") {
        if (out.integrator != "bathe") {
            throw BadInput(fmt::format(
                "--controller {} is of the averaged scheme: --integrator bathe", out.controller));
        }
        out.bathe.controller = ErrorStep{.order = 3, .reject_above = 100};
        if (out.controller == "learned") {
            out.bathe.controller =
                LearnedStep{.policy = named_policy(fault_step_layout(), run.model)};
        }
        out.bathe.estimate = ErrorEstimate::embedded;
        return out;
    }
    out.bathe.estimate = ErrorEstimate::doubling;
    out.bathe.norm = FaultNorm::components;
    if (out.controller == "heuristic") out.bathe.controller = HeuristicStep{};
    if (out.controller == "pi") out.bathe.controller = FilteredStep::pi3333();
    if (out.controller == "filter") out.bathe.controller = FilteredStep::h211b(4);
    return out;
}

RuptureOptions options(const SystemEntry& system, const SimulateRequest& request)
{
    const RunRequest& run = request.run;
    RuptureOptions out;
    out.t_end = run.t_end.value_or(system.t_end);
    if (!(out.t_end > 0)) {
        throw BadInput(fmt::format("--t-end must be positive, got {}", out.t_end));
    }
    if (run.step && !(*run.step > 0)) {
        throw BadInput(fmt::format("--step must be positive, got {}", *run.step));
    }
    if (run.rtol && !(*run.rtol > 0)) {
        throw BadInput(fmt::format("--rtol must be positive, got {}", *run.rtol));
    }
    out.step = run.step.value_or(0);
    if (run.step && !run.rtol) out.rtol = std::numeric_limits<double>::infinity();
    if (run.rtol) out.rtol = *run.rtol;
    if (run.max_steps) out.max_steps = *run.max_steps;
    out.progress = [](double) { return !Interrupts::any(); };
    if (request.plot) {
        constexpr int pictures = 120;
        for (int i = 0; i <= pictures; ++i) {
            out.snapshot_times.push_back(std::min(out.t_end, i * (out.t_end / pictures)));
        }
    }
    return out;
}

std::string json(const SystemEntry& system, const std::vector<double>& values,
                 const StrikeSlipFault& fault, const RuptureOptions& asked, const Integration& how,
                 const Rupture& r, const SimulateRequest& request, double seconds)
{
    Json parameters = Json::object();
    for (std::size_t i = 0; i < weakening_parameters; ++i) {
        parameters[std::string(system.parameters[i].name)] = values[i];
    }
    const RuptureStatistics& s = r.statistics;
    Json out{{"system", system.name},
             {"parameters", parameters},
             {"integrator", how.integrator},
             {"outcome", ricochet::name(r.outcome)},
             {"t", r.t},
             {"mean_slip", r.mean_slip},
             {"peak_velocity", r.peak_velocity},
             {"peak_time", r.peak_time},
             {"arrest_time", r.arrest_time},
             {"rest_time", r.rest_time},
             {"largest_slip", r.slip.maxCoeff()},
             {"kernel_factor", fault.factor()},
             {"longest_step", r.longest_step},
             {"polynomial", {{"degree", s.degree}, {"error_bound", s.bound}}},
             {"statistics",
              {{"steps", s.steps},
               {"rejected", s.rejected},
               {"force_evaluations", s.evaluations},
               {"stiffness_products", s.products},
               {"arrests", s.arrests},
               {"restarts", s.restarts}}},
             {"memory_estimate", StrikeSlipFault::memory(fault.parameters())}};
    if (how.integrator == "explicit") {
        out["stable_step"] = r.stable_step;
        out["rtol"] = asked.rtol;
    } else {
        out["controller"] = how.controller;
        out["step"] = asked.step;
        out["statistics"]["solves"] = s.solves;
        out["statistics"]["iterations"] = s.iterations;
        if (how.controller == "learned") out["statistics"]["handed_over"] = s.handed_over;
    }
    if (r.outcome == Outcome::cancelled) out["incomplete"] = Interrupts::cause();
    if (request.kernel) out["kernel"] = request.kernel->string();
    if (request.samples) {
        const MeanSamples samples = sampled(r, asked.t_end, *request.samples);
        out["trajectory"] = {
            {"t", samples.t}, {"mean_slip", samples.slip}, {"mean_velocity", samples.velocity}};
    }
    out["seconds"] = seconds;
    return json_text(out);
}

std::string text(const SystemEntry& system, const StrikeSlipFault& fault, const Rupture& r,
                 double seconds)
{
    const RuptureStatistics& s = r.statistics;
    const auto& p = fault.parameters();
    std::string out = fmt::format("{}: {} x {} elements on a square of {} m, {}\n", system.name,
                                  p.elements, p.elements, p.side,
                                  !p.kernel.empty() ? "kernel " + p.kernel.string()
                                  : p.medium == FaultMedium::half_space ? "half space"
                                                                        : "full space");
    out += fmt::format("{:<16}{:.6f} m\n", "mean slip", r.mean_slip);
    out += fmt::format("{:<16}{:.6f} m/s at {:.6f} s\n", "peak velocity", r.peak_velocity,
                       r.peak_time);
    if (!std::isnan(r.arrest_time)) out += fmt::format("{:<16}{:.6f} s\n", "arrest", r.arrest_time);
    if (!std::isnan(r.rest_time)) out += fmt::format("{:<16}{:.6f} s\n", "at rest", r.rest_time);
    out += fmt::format("ended at {} s: {}\n", r.t, describe(r.outcome));
    out += fmt::format("{} steps of at most {:.4g} s, {} rejected, {} products with K\n", s.steps,
                       r.longest_step, s.rejected, s.products);
    out += s.solves > 0 ? fmt::format("{} stages in {} Newton iterations\n", s.solves, s.iterations)
                        : fmt::format("{} force evaluations; stable up to {:.4g} s\n",
                                      s.evaluations, r.stable_step);
    if (s.asked > 0) {
        out += fmt::format("{} of {} steps left to the classical rule\n", s.handed_over, s.asked);
    }
    out += fmt::format("sqrt(K) by a polynomial of degree {}, within {:.2g}\n{:.3g} s of time\n",
                       s.degree, s.bound, seconds);
    return out;
}

std::string csv(const MeanSamples& samples)
{
    std::string out = "t [s],mean slip [m],mean velocity [m/s]\n";
    for (std::size_t i = 0; i < samples.t.size(); ++i) {
        out += fmt::format("{},{},{}\n", samples.t[i], samples.slip[i], samples.velocity[i]);
    }
    return out;
}

const RuptureSnapshot& nearest(const Rupture& r, double t)
{
    return *std::min_element(r.snapshots.begin(), r.snapshots.end(), [t](auto& a, auto& b) {
        return std::abs(a.t - t) < std::abs(b.t - t);
    });
}

void draw_rupture(const StrikeSlipFault& fault, const RuptureOptions& asked, const Rupture& r,
                  const std::filesystem::path& file)
{
    const MeanSamples samples = sampled(r, asked.t_end, 1001);
    std::string mean;
    for (std::size_t i = 0; i < samples.t.size(); ++i) {
        mean += fmt::format("{} {} {}\n", samples.t[i], samples.slip[i], samples.velocity[i]);
    }
    const double unit = fault.time_unit();
    const RuptureSnapshot* times[] = {&nearest(r, r.peak_time - 2 * unit), &nearest(r, r.peak_time),
                                      &nearest(r, r.peak_time + 1.5 * unit)};
    PlotFiles files{{"mean", mean},
                    {"slip", fault_map(fault, r.slip)},
                    {"peak", fault_map(fault, r.peak_velocity_of)}};
    for (std::size_t i = 0; i < 3; ++i) {
        files.emplace_back(fmt::format("velocity{}", i), fault_map(fault, times[i]->velocity));
    }
    std::string script =
        plot_head(file, 1500, 1250) +
        fmt::format(
            "set multiplot layout 3,3 title 'strike-slip fault, {0} x {0} elements: mean slip "
            "{1:.4g} m'.\"\\n\"\n"
            "set xlabel 'time [s]'\nset ylabel 'mean slip [m]'\n"
            "plot 'mean' using 1:2 with lines linestyle 1 notitle\n"
            "set ylabel 'mean velocity [m/s]'\n"
            "plot 'mean' using 1:3 with lines linestyle 1 notitle\n"
            "set multiplot next\n"
            "set size ratio -1\nset yrange [{2}:0] \nset xrange [0:{2}]\nunset grid\n"
            "set xlabel 'along strike [km]'\nset ylabel 'depth [km]'\n",
            fault.elements(), r.mean_slip, fault.parameters().side / 1000);
    script +=
        "set title 'slip [m]'\nplot 'slip' with image notitle\n"
        "set title 'largest velocity [m/s]'\nplot 'peak' with image notitle\n"
        "set multiplot next\n";
    script += fmt::format("set cbrange [0:{}]\n", std::max(1e-12, r.peak_velocity_of.maxCoeff()));
    for (std::size_t i = 0; i < 3; ++i) {
        script += fmt::format(
            "set title 'velocity [m/s] at {:.2f} s'\nplot 'velocity{}' with image notitle\n",
            times[i]->t, i);
    }
    draw(files, script + "unset multiplot\n", file);
}

}  // namespace

MeanSamples sampled(const Rupture& r, double t_end, std::size_t n)
{
    MeanSamples out;
    std::size_t at = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double t = t_end * static_cast<double>(i) / static_cast<double>(n - 1);
        while (at + 2 < r.times.size() && r.times[at + 1] < t) ++at;
        const double span = r.times[at + 1] - r.times[at];
        const double x = span > 0 ? std::clamp((t - r.times[at]) / span, 0.0, 1.0) : 1;
        out.t.push_back(t);
        out.slip.push_back(std::lerp(r.mean_slips[at], r.mean_slips[at + 1], x));
        out.velocity.push_back(std::lerp(r.mean_velocities[at], r.mean_velocities[at + 1], x));
    }
    return out;
}

std::string fault_map(const StrikeSlipFault& fault, const Eigen::VectorXd& values)
{
    std::string out;
    const int n = fault.elements();
    if (n == 1) {  // a picture of one point would be empty: it has four
        const double side = fault.parameters().side / 1000;
        for (const double z : {0.25, 0.75}) {
            for (const double x : {0.25, 0.75}) {
                out += fmt::format("{} {} {}\n", x * side, z * side, values[0]);
            }
            out += '\n';
        }
        return out;
    }
    for (int z = 0; z < n; ++z) {
        for (int x = 0; x < n; ++x) {
            out += fmt::format("{} {} {}\n", fault.depth(x) / 1000, fault.depth(z) / 1000,
                               values[Eigen::Index{z} * n + x]);
        }
        out += '\n';
    }
    return out;
}

int simulate_fault(const SystemEntry& system, const SimulateRequest& request)
{
    if (request.phase)
        throw BadInput("--phase is not for the system fault, whose picture is a map");
    refuse_what_is_not_for_faults(request.run);
    const std::vector<double> values = parameter_values(system, request.run.set);
    if (has_rate_and_state(values)) return simulate_rate_state_fault(system, request, values);
    refuse_rate_and_state(request.run.set, system);
    const Integration how = integration(request.run);
    RuptureOptions asked = options(system, request);
    validate(asked);
    Claims claims;
    if (request.kernel) claims.reads("--kernel", *request.kernel);
    if (how.controller == "learned") {
        claims.reads("the model", policy_file(fault_step_layout(), request.run.model));
    }
    claim_results(claims, request);
    const Interrupts interrupts;
    const auto start = std::chrono::steady_clock::now();
    const StrikeSlipFault fault(fault_parameters(values, request.kernel));
    const bool implicit = how.integrator != "explicit";
    constexpr double usual = 0.125 / 0.8660254037844386;  // 0.125 s at 3 km
    if (implicit && asked.step == 0) asked.step = usual * fault.time_unit();
    LongRun progress;
    const RuptureOptions watched = shown(asked, progress, "simulate fault");
    const Rupture r = [&] {
        const RunWatch watch(0.25);
        return implicit ? ricochet::simulate(fault, watched, how.bathe)
                        : ricochet::simulate(fault, watched);
    }();
    progress.clear();
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    const bool cancelled = r.outcome == Outcome::cancelled;
    if (cancelled) asked.t_end = r.t;  // of samples and pictures
    deliver(
        {[&] {
             print(request.json ? json(system, values, fault, asked, how, r, request, taken.count())
                                : text(system, fault, r, taken.count()));
         },
         [&] {
             if (!request.csv) return;
             const std::string table = csv(sampled(r, asked.t_end, request.samples.value_or(1001)));
             write_file(*request.csv, cancelled ? table + incomplete_line() : table);
         },
         [&] {
             if (request.plot) draw_rupture(fault, asked, r, *request.plot);
         }});
    if (cancelled) return ended_early(fmt::format("at t = {} s", r.t));
    return r.outcome == Outcome::reached_end || r.outcome == Outcome::at_rest ? 0 : 1;
}

}  // namespace ricochet::app
