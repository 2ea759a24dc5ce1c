#include "scene_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "../files.hpp"
#include "../input.hpp"
#include "../interrupt.hpp"
#include "../plot.hpp"
#include "../run_watch.hpp"
#include "ricochet/scene/simulate.hpp"
#include "scene_pictures.hpp"

namespace ricochet::app {

namespace {

constexpr std::size_t default_samples = 501;

std::vector<double> evenly(double start, double end, std::size_t n)
{
    std::vector<double> times(n);
    for (std::size_t i = 0; i < n; ++i) {
        const double part = static_cast<double>(i) / static_cast<double>(n - 1);
        times[i] = std::min(start + part * (end - start), end);
    }
    times.back() = end;
    return times;
}

void check_animation(const std::string& file)
{
    if (file.ends_with(".svg")) return;
    throw BadInput(fmt::format("--animate must be a file ending in .svg, got '{}'", file));
}

}  // namespace

SceneFile requested_scene(const SceneRequest& request)
{
    SceneFile file = [&] {
        try {
            return load_scene(request.file);
        } catch (const SceneFileError& error) {
            throw BadInput(error.what());
        }
    }();
    SceneOptions& options = file.options;
    options.t_start = request.t_start.value_or(options.t_start);
    options.t_end = request.t_end.value_or(options.t_end);
    options.rtol = request.rtol.value_or(options.rtol);
    options.atol = request.atol.value_or(options.atol);
    options.contact_step = request.contact_step.value_or(options.contact_step);
    options.max_events = request.max_events.value_or(options.max_events);
    options.contacts = scene_contacts();
    if (std::isnan(options.t_end)) {
        throw BadInput(fmt::format("{} has no \"t_end\" under \"run\"; expected it, or --t-end",
                                   request.file));
    }
    return file;
}

int simulate_scene(const SceneRequest& request)
{
    SceneFile file = requested_scene(request);
    Claims claims;
    claims.reads("the scene", request.file);
    if (request.csv) claims.writes("--csv", *request.csv);
    if (request.plot) {
        check_plot(*request.plot);
        claims.writes("--plot", *request.plot);
    }
    if (request.animate) {
        check_animation(*request.animate);
        claims.writes("--animate", *request.animate);
    }
    const bool sampled = request.csv || request.plot || request.animate;
    if (request.samples || (sampled && file.options.sample_times.empty())) {
        file.options.sample_times = evenly(file.options.t_start, file.options.t_end,
                                           request.samples.value_or(default_samples));
    }
    const bool samples = request.samples || (!sampled && !file.options.sample_times.empty());

    const Interrupts interrupts;
    file.options.cancelled = Interrupts::flag();
    if (request.no_events) file.options.record_events = false;
    PrintedEvents events(file.scene);
    const bool printed = request.json && file.options.record_events;
    if (printed) {
        // The picture shows them, too; else none is kept.
        file.options.record_events = request.animate.has_value();
        file.options.observe = [&](const SceneEvent& event) { events.add(event); };
    }
    const SceneRun run = [&] {
        const RunWatch watch(request.json ? 1.0 / 20 : 1.0 / 6);
        return simulate(file.scene, file.options);
    }();
    const auto report = [&] {
        if (printed) events.end();
        print(request.json ? scene_json(file, run, samples, printed) : scene_text(file, run));
    };
    deliver({report,
             [&] {
                 if (request.csv) write_file(*request.csv, scene_csv(file, run));
             },
             [&] {
                 if (request.animate) write_file(*request.animate, animated_scene(file, run));
             },
             [&] {
                 if (request.plot) plot_scene(file, run, *request.plot);
             }});
    if (run.outcome == Outcome::cancelled) return ended_early(fmt::format("at t = {} s", run.t));
    return run.outcome == Outcome::reached_end ? 0 : 1;
}

int explain_scene(const SceneRequest& request)
{
    const SceneFile file = requested_scene(request);
    print(explain(file.scene, file.options));
    return 0;
}

}  // namespace ricochet::app
