// `simulate spring-slider`.
#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "fault.hpp"
#include "files.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "json_text.hpp"
#include "plot.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "run_watch.hpp"
#include "simulate.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t {
    ratio,
    velocity,
    a,
    b,
    f_star,
    v_star,
    d_rs,
    mass,
    force,
    law,
    threshold,
    order
};

SpringSlider slider_of(const std::vector<double>& p)
{
    SpringSlider out;
    out.friction = {
        .a = p[a], .b = p[b], .f_star = p[f_star], .v_star = p[v_star], .d_rs = p[d_rs]};
    out.evolution = p[law] == 0   ? StateEvolution::ageing
                    : p[law] == 1 ? StateEvolution::slip
                                  : StateEvolution::prz;
    const double critical = critical_stiffness(out.friction, p[mass], p[force], p[velocity]);
    if (!(critical > 0)) {
        throw BadInput(fmt::format(
            "the spring-slider needs b > a for a critical stiffness, got a = {} and b = {}", p[a],
            p[b]));
    }
    out.block = {.mass = p[mass], .stiffness = p[ratio] * critical, .normal_force = p[force]};
    out.load = SliderLoad(p[force] * p[f_star] / out.block.stiffness, p[velocity]);
    return out;
}

std::vector<double> shown(const SpringSlider& slider, const SliderState& s)
{
    const RateStateParameters& p = slider.friction;
    return {s.x, s.v, std::log10(std::abs(s.v) / p.v_star), slider_friction(slider, s),
            std::exp(s.xi) * p.d_rs / p.v_star};
}

/// Refuses options of the event loop that have no meaning here.
void refuse_others(const RunRequest& run)
{
    const auto refuse = [](bool given, std::string_view option) {
        if (!given) return;
        throw BadInput(
            fmt::format("{} is not for the spring-slider, whose steps are variational", option));
    };
    refuse(run.t_start.has_value(), "--t-start");
    refuse(run.mode.has_value(), "--mode");
    refuse(run.detector.has_value(), "--detector");
    refuse(run.gate.has_value(), "--gate");
    refuse(run.locator.has_value(), "--locator");
    refuse(run.stepper.has_value(), "--stepper");
    refuse(run.model.has_value(), "--model");
    refuse(run.atol.has_value(), "--atol");
    refuse(run.integrator.has_value(), "--integrator");
    refuse(run.controller.has_value(), "--controller");
    refuse(run.event_tolerance.has_value(), "--event-tolerance");
}

double positive(std::string_view option, const std::optional<double>& given, double otherwise)
{
    const double value = given.value_or(otherwise);
    if (!(value > 0)) throw BadInput(fmt::format("{} must be positive, got {}", option, value));
    return value;
}

/// Run as the event loop would have returned it, for its reports.
Run<std::vector<double>> plain(const SpringSlider& slider, const SliderRun& run)
{
    Run<std::vector<double>> out;
    out.outcome = run.outcome;
    out.t = run.state.t;
    out.x = shown(slider, run.state);
    for (const SliderState& s : run.samples) {
        out.trajectory.t.push_back(s.t);
        out.trajectory.x.push_back(shown(slider, s));
    }
    for (const SliderEvent& e : run.events) {
        Event<std::vector<double>> event;
        event.t = e.at.t;
        event.guard = static_cast<std::size_t>(e.kind);
        event.before = event.after = shown(slider, e.at);
        out.events.push_back(std::move(event));
    }
    return out;
}

std::string stepping(const SliderOptions& options)
{
    return options.step > 0
               ? fmt::format("variational steps of order {}, {} s", options.order, options.step)
               : fmt::format("variational steps of order {}, rtol {}", options.order, options.rtol);
}

std::string to_text(const SpringSlider& slider, const RunSettings& settings,
                    const SliderOptions& options, const SliderRun& run)
{
    std::string out = fmt::format(
        "{}\n{}: {} steps, {} rejected, {} stages of {:.1f} iterations, "
        "residual {:.0e}, {} unsolved\n\n",
        title(find_system("spring-slider"), settings), stepping(options), run.steps, run.rejected,
        run.stages,
        static_cast<double>(run.iterations) /
            static_cast<double>(std::max<std::size_t>(run.stages, 1)),
        run.residual, run.unsolved);
    out += fmt::format("{:>22} {:<9} {:>13} {:>13} {:>9}\n", "t [s]", "", "x [m]", "V [m/s]", "f");
    constexpr std::size_t most = 40;
    for (std::size_t i = 0; i < run.events.size() && i < most; ++i) {
        const SliderEvent& e = run.events[i];
        out += fmt::format("{:>22.15g} {:<9} {:>13.6e} {:>13.6e} {:>9.6f}\n", e.at.t, name(e.kind),
                           e.at.x, e.at.v, slider_friction(slider, e.at));
    }
    if (run.events.size() > most) {
        out += fmt::format("and {} more\n", run.events.size() - most);
    }
    return out + fmt::format("{:>22.15g} {:<9} {:>13.6e} {:>13.6e} {:>9.6f}\n\n{}\n", run.state.t,
                             "end", run.state.x, run.state.v, slider_friction(slider, run.state),
                             run.outcome == Outcome::cancelled
                                 ? fmt::format("incomplete: {}", Interrupts::cause())
                                 : std::string(describe(run.outcome)));
}

std::string to_json(const SpringSlider& slider, const SliderOptions& options, const SliderRun& run,
                    bool with_trajectory)
{
    Json events = Json::array();
    for (const SliderEvent& e : run.events) {
        events.push_back({{"t", e.at.t}, {"kind", name(e.kind)}, {"state", shown(slider, e.at)}});
    }
    Json out{{"system", "spring-slider"},
             {"outcome", ricochet::name(run.outcome)},
             {"t", run.state.t},
             {"state", shown(slider, run.state)},
             {"order", options.order},
             {"step", options.step > 0 ? Json(options.step) : Json()},
             {"rtol", options.step > 0 ? Json() : Json(options.rtol)},
             {"stiffness", slider.block.stiffness},
             {"events", events},
             {"steps", run.steps},
             {"rejected", run.rejected},
             {"stages", run.stages},
             {"iterations", run.iterations},
             {"unsolved", run.unsolved},
             {"not_convex", run.not_convex},
             {"residual", run.residual}};
    if (run.outcome == Outcome::cancelled) out["incomplete"] = Interrupts::cause();
    if (with_trajectory) {
        const Run<std::vector<double>> all = plain(slider, run);
        out["trajectory"] = {{"t", all.trajectory.t}, {"x", all.trajectory.x}};
    }
    return json_text(out);
}

}  // namespace

int simulate_spring_slider(const SystemEntry& entry, const SimulateRequest& request)
{
    refuse_others(request.run);
    RunSettings settings;
    settings.parameters = parameter_values(entry, request.run.set);
    const std::vector<double>& p = settings.parameters;
    if (p[law] != std::floor(p[law])) {
        throw BadInput(fmt::format("law must be 0, 1 or 2, got {}", p[law]));
    }
    if (p[order] != 1 && p[order] != 2 && p[order] != 4) {
        throw BadInput(fmt::format("order must be 1, 2 or 4, got {}", p[order]));
    }
    const SpringSlider slider = slider_of(p);
    SliderOptions options{.t_end = positive("--t-end", request.run.t_end, entry.t_end),
                          .order = static_cast<int>(p[order]),
                          .rtol = positive("--rtol", request.run.rtol, 1e-8),
                          .threshold = p[threshold]};
    if (request.run.step) options.step = positive("--step", request.run.step, 1);
    if (request.run.max_steps) options.max_steps = *request.run.max_steps;
    if (request.samples || request.csv || request.plot) {
        options.samples = request.samples.value_or(2001);
    }
    if (request.kernel) throw BadInput("--kernel is for the system fault");
    Claims claims;
    claim_results(claims, request);
    const std::optional<PhasePlane> plane = phase_plane(entry, request);
    settings.options.t_end = options.t_end;

    const Interrupts interrupts;
    options.cancelled = Interrupts::flag();
    const SliderState start{.v = slider.friction.v_star};
    const SliderRun run = [&] {
        const RunWatch watch(1.0 / 20);
        return run_slider(slider, start, options);
    }();
    deliver({[&] {
                 print(request.json ? to_json(slider, options, run, request.samples.has_value())
                                    : to_text(slider, settings, options, run));
             },
             [&] {
                 if (request.csv) write_file(*request.csv, to_csv(entry, plain(slider, run)));
             },
             [&] {
                 if (request.plot) plot(entry, settings, plain(slider, run), *request.plot, plane);
             }});
    if (run.outcome == Outcome::cancelled) {
        return ended_early(fmt::format("at t = {} s", run.state.t));
    }
    return run.outcome == Outcome::reached_end ? 0 : 1;
}

}  // namespace ricochet::app
