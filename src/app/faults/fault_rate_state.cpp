// `simulate fault --set rate_and_state=1`.
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
#include "report.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "run_watch.hpp"
#include "simulate.hpp"
#include "step_progress.hpp"

namespace ricochet::app {

namespace {

constexpr double year = 365.25 * 86400;  // [s]

/// Parameters of the entry, after those of the fault.
enum : std::size_t {
    rate_and_state = weakening_parameters,
    a,
    b,
    f_star,
    v_star,
    d_rs,
    law,
    plate_velocity,
    slip_rate,
    theta,
    normal_stress,
    threshold,
    order,
    all_parameters
};

/// Parameters of friction that weakens with slip; the slip distance is then only a unit.
constexpr std::string_view of_weakening[] = {"residual_friction", "friction_drop", "slip_distance"};

FaultFriction friction_of(const std::vector<double>& p)
{
    constexpr std::size_t overload = 10;
    FaultFriction out{
        .law = {.a = p[a], .b = p[b], .f_star = p[f_star], .v_star = p[v_star], .d_rs = p[d_rs]},
        .plate_velocity = p[plate_velocity],
        .normal_stress = p[normal_stress],
        .slip_rate = p[slip_rate],
        .overload = p[overload]};
    const double which = whole("law", p[law]);
    out.evolution = which == 0   ? StateEvolution::ageing
                    : which == 1 ? StateEvolution::slip
                                 : StateEvolution::prz;
    if (p[theta] > 0) out.theta = p[theta];
    return out;
}

void refuse_what_is_not_for_these(const RunRequest& run)
{
    if (run.integrator) {
        throw BadInput("--integrator is for friction that weakens with slip; take --set order=");
    }
    if (run.controller) throw BadInput("--controller is for friction that weakens with slip");
    for (const std::string_view name : of_weakening) {
        if (given(run.set, name)) {
            throw BadInput(fmt::format("{} of fault is not for rate_and_state=1", name));
        }
    }
}

RuptureOptions options_of(const RunRequest& run)
{
    RuptureOptions out;
    out.t_end = run.t_end.value_or(1e9);
    out.rtol = run.rtol.value_or(1e-3);
    if (run.step) {
        if (!(*run.step > 0)) {
            throw BadInput(fmt::format("--step must be positive, got {}", *run.step));
        }
        out.step = *run.step;
        if (!run.rtol) out.rtol = std::numeric_limits<double>::infinity();
    }
    if (run.max_steps) out.max_steps = *run.max_steps;
    out.progress = [](double) { return !Interrupts::any(); };
    return out;
}

Json earthquakes(const RateStateRupture& r)
{
    Json out = Json::array();
    for (const FaultEarthquake& e : r.earthquakes) {
        out.push_back({{"start", e.start},
                       {"end", e.end},
                       {"mean_slip", e.mean_slip},
                       {"largest_velocity", e.largest_velocity}});
    }
    return out;
}

std::string json(const SystemEntry& system, const std::vector<double>& values,
                 const StrikeSlipFault& fault, const RuptureOptions& asked,
                 const RateStateRupture& r, const SimulateRequest& request, double seconds)
{
    Json parameters = Json::object();
    for (std::size_t i = 0; i < values.size(); ++i) {
        const std::string_view name = system.parameters[i].name;
        const bool used = std::find(std::begin(of_weakening), std::end(of_weakening), name) ==
                          std::end(of_weakening);
        if (used) parameters[std::string(name)] = values[i];
    }
    const Rupture& rupture = r.rupture;
    const RuptureStatistics& s = rupture.statistics;
    Json out{{"system", system.name},
             {"parameters", parameters},
             {"rtol", asked.rtol},
             {"outcome", ricochet::name(rupture.outcome)},
             {"t", rupture.t},
             {"earthquakes", earthquakes(r)},
             {"mean_slip", rupture.mean_slip},
             {"peak_velocity", rupture.peak_velocity},
             {"peak_time", rupture.peak_time},
             {"largest_slip", rupture.slip.maxCoeff()},
             {"fastest", r.fastest.back()},
             {"elements_of_front", r.elements_of_front},
             {"kernel_factor", fault.factor()},
             {"polynomial", {{"degree", s.degree}, {"error_bound", s.bound}}},
             {"largest_residual", r.residual},
             {"statistics",
              {{"steps", s.steps},
               {"rejected", s.rejected},
               {"stages", s.solves},
               {"unsolved_stages", r.unsolved},
               {"handed_over", r.handed_over},
               {"newton_iterations", s.iterations},
               {"inner_iterations", r.inner},
               {"stiffness_products", s.products}}},
             {"memory_estimate", StrikeSlipFault::memory(fault.parameters())}};
    if (rupture.outcome == Outcome::cancelled) out["incomplete"] = Interrupts::cause();
    if (request.kernel) out["kernel"] = request.kernel->string();
    if (request.samples) {
        const MeanSamples samples = sampled(rupture, asked.t_end, *request.samples);
        out["trajectory"] = {
            {"t", samples.t}, {"mean_slip", samples.slip}, {"mean_velocity", samples.velocity}};
    }
    out["seconds"] = seconds;
    return json_text(out);
}

std::string text(const SystemEntry& system, const StrikeSlipFault& fault, const RateStateRupture& r,
                 double seconds)
{
    const RuptureStatistics& s = r.rupture.statistics;
    const auto& p = fault.parameters();
    std::string out = fmt::format(
        "{}: {} x {} elements on a square of {} m, rate-and-state friction\n"
        "a front is {:.2g} elements wide\n",
        system.name, p.elements, p.elements, p.side, r.elements_of_front);
    out += fmt::format("{:>14}{:>14}{:>14}{:>20}\n", "earthquake [y]", "lasts [s]", "slip [m]",
                       "fastest [m/s]");
    for (const FaultEarthquake& e : r.earthquakes) {
        const double lasts = e.end - e.start;
        out += fmt::format("{:>14.6f}{:>14}{:>14.6g}{:>20.6g}\n", e.start / year,
                           std::isnan(lasts) ? "not over" : fmt::format("{:.6g}", lasts),
                           e.mean_slip, e.largest_velocity);
    }
    if (r.earthquakes.empty()) out += fmt::format("{:>14}\n", "none");
    if (r.elements_of_front < 1) {
        out += "below one element to a front elements fail each on its own: take more of them\n";
    }
    out += fmt::format("ended at {} s, {:.4g} years: {}\n", r.rupture.t, r.rupture.t / year,
                       describe(r.rupture.outcome));
    out += fmt::format("mean slip {:.6g} m; the fastest element slips at {:.4g} m/s\n",
                       r.rupture.mean_slip, r.fastest.back());
    out += fmt::format(
        "{} steps, {} rejected, {} handed over to order 2; {} stages in {} Newton iterations, {} "
        "unsolved; residual {:.2g}\n"
        "{} products with K; sqrt(K) by a polynomial of degree {}, within {:.2g}\n"
        "{:.3g} s of time\n",
        s.steps, s.rejected, r.handed_over, s.solves, s.iterations, r.unsolved, r.residual,
        s.products, s.degree, s.bound, seconds);
    return out;
}

/// Rows at the ends of the steps: even times would miss the earthquakes.
std::string csv(const RateStateRupture& r, char separator)
{
    constexpr std::size_t parts = 4;  // of a step, in the history of the means
    std::string out;
    for (std::size_t i = 0; i < r.step_times.size(); ++i) {
        out += fmt::format("{1}{0}{2}{0}{3}{0}{4}\n", separator, r.step_times[i],
                           r.rupture.mean_slips[parts * i], r.rupture.mean_velocities[parts * i],
                           r.fastest[i]);
    }
    return out;
}

/// Three times within the earthquake of the largest slip; without one, within the run.
std::vector<double> times_of_pictures(const RateStateRupture& r)
{
    double from = 0;
    double to = r.rupture.t;
    double slip = 0;
    for (const FaultEarthquake& e : r.earthquakes) {
        if (!(e.mean_slip > slip)) continue;
        slip = e.mean_slip;
        from = e.start;
        to = std::isnan(e.end) ? r.rupture.t : e.end;
    }
    return {std::lerp(from, to, 0.6), std::lerp(from, to, 0.75), std::lerp(from, to, 0.9)};
}

void draw_cycle(const StrikeSlipFault& fault, const RateStateRupture& r,
                const std::filesystem::path& file)
{
    PlotFiles files{{"steps", csv(r, ' ')}, {"slip", fault_map(fault, r.rupture.slip)}};
    std::string script =
        plot_head(file, 1500, 850) +
        fmt::format(
            "set multiplot layout 2,3 title 'strike-slip fault with rate-and-state friction, {0} "
            "x {0} elements'.\"\\n\"\n"
            "set xlabel 'time [years]'\nset logscale y\nset format y '1e%T'\n"
            "set ylabel 'fastest element [m/s]'\n"
            "plot 'steps' using ($1/{1}):4 with lines linestyle 1 notitle\n"
            "unset logscale y\nset format y '%g'\nset ylabel 'mean slip [m]'\n"
            "plot 'steps' using ($1/{1}):2 with lines linestyle 1 notitle\n"
            "set size ratio -1\nset yrange [{2}:0]\nset xrange [0:{2}]\n"
            "set xlabel 'along strike [km]'\nset ylabel 'depth [km]'\n"
            "unset grid\n"
            "set title 'slip [m]'\nplot 'slip' with image notitle\n",
            fault.elements(), year, fault.parameters().side / 1000);
    const auto& pictures = r.rupture.snapshots;
    for (std::size_t i = 0; i < pictures.size(); ++i) {
        const std::string name = fmt::format("velocity{}", i);
        files.emplace_back(name, fault_map(fault, pictures[i].velocity));
        script += fmt::format(
            "set title 'velocity [m/s], {:.1f} s after the first picture'\nplot '{}' with image "
            "notitle\n",
            pictures[i].t - pictures[0].t, name);
    }
    draw(files, script + "unset multiplot\n", file);
}

}  // namespace

int simulate_rate_state_fault(const SystemEntry& system, const SimulateRequest& request,
                              const std::vector<double>& values)
{
    refuse_what_is_not_for_these(request.run);
    RuptureOptions asked = options_of(request.run);
    const FaultFriction friction = friction_of(values);
    const RateStateOptions how{.order = static_cast<int>(whole("order", values[order])),
                               .threshold = values[threshold]};
    validate(asked);
    validate(friction);
    validate(how);
    Claims claims;
    if (request.kernel) claims.reads("--kernel", *request.kernel);
    claim_results(claims, request);
    const Interrupts interrupts;
    const auto start = std::chrono::steady_clock::now();
    const StrikeSlipFault fault(fault_parameters(values, request.kernel));
    LongRun progress;
    RateStateRupture r = [&] {
        const RunWatch watch(0.25);
        return ricochet::simulate(fault, shown(asked, progress, "simulate fault"), friction, how);
    }();
    progress.clear();
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    const bool cancelled = r.rupture.outcome == Outcome::cancelled;
    if (cancelled) asked.t_end = r.rupture.t;  // of samples
    deliver({[&] {
                 print(request.json ? json(system, values, fault, asked, r, request, taken.count())
                                    : text(system, fault, r, taken.count()));
             },
             [&] {
                 if (!request.csv) return;
                 write_file(*request.csv,
                            "t [s],mean slip [m],mean velocity [m/s],fastest [m/s]\n" +
                                csv(r, ',') + (cancelled ? incomplete_line() : ""));
             },
             [&] {
                 if (!request.plot) return;
                 // The times of the earthquakes are known only now: the run is repeated for its
                 // pictures, of which an interrupted one has none.
                 asked.snapshot_times = times_of_pictures(r);
                 if (!cancelled) {
                     const RuptureOptions again =
                         shown(asked, progress, "simulate fault for its pictures");
                     r.rupture.snapshots =
                         ricochet::simulate(fault, again, friction, how).rupture.snapshots;
                     progress.clear();
                 }
                 draw_cycle(fault, r, *request.plot);
             }});
    if (cancelled) return ended_early(fmt::format("at t = {} s", r.rupture.t));
    return r.rupture.outcome == Outcome::reached_end ? 0 : 1;
}

}  // namespace ricochet::app
