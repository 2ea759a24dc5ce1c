#include "simulate.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "files.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "plot.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "run_watch.hpp"

namespace ricochet::app {

namespace {

constexpr std::size_t default_samples = 1001;

/// `n` >= 2 times from start to end, both included; the end may lie before the start.
std::vector<double> evenly(double start, double end, std::size_t n)
{
    std::vector<double> times(n);
    for (std::size_t i = 0; i + 1 < n; ++i) {
        const double share = static_cast<double>(i) / static_cast<double>(n - 1);
        const double t = start + share * (end - start);
        times[i] = end < start ? std::max(t, end) : std::min(t, end);
    }
    times.back() = end;
    return times;
}

}  // namespace

void claim_results(Claims& claims, const SimulateRequest& request)
{
    if (request.csv) claims.writes("--csv", *request.csv);
    if (request.plot) {
        check_plot(*request.plot);
        claims.writes("--plot", *request.plot);
    }
}

int simulate(const SimulateRequest& request)
{
    const SystemEntry& system = find_system(request.system);
    if (request.kernel) throw BadInput("--kernel is for the system fault");
    RunSettings settings = resolve(system, request.run);
    Claims claims;
    if (!settings.model.empty()) claims.reads("the model", settings.model);
    claim_results(claims, request);
    const std::optional<PhasePlane> plane = phase_plane(system, request);
    if (request.samples || request.csv || request.plot) {
        settings.options.sample_times = evenly(settings.options.t_start, settings.options.t_end,
                                               request.samples.value_or(default_samples));
    }

    const Interrupts interrupts;
    const TimedRun timed = [&] {
        // As JSON an event takes 15 times as much memory, and as text 5 times.
        const RunWatch watch(request.json ? 1.0 / 20 : 1.0 / 12);
        return system.run(settings, 1);
    }();
    deliver({[&] {
                 print(request.json ? to_json(system, settings, timed, request.samples.has_value())
                                    : to_text(system, settings, timed));
             },
             [&] {
                 if (request.csv) write_file(*request.csv, to_csv(system, timed.run));
             },
             [&] {
                 if (request.plot) plot(system, settings, timed.run, *request.plot, plane);
             }});
    const Outcome outcome = timed.run.outcome;
    if (outcome == Outcome::cancelled) return ended_early(fmt::format("at t = {} s", timed.run.t));
    return outcome == Outcome::reached_end || outcome == Outcome::stopped_by_event ? 0 : 1;
}

}  // namespace ricochet::app
