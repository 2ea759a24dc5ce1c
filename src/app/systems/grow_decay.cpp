#include "problems/grow_decay.hpp"

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {GrowDecay::start[0]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(GrowDecay{}, start(settings.parameters), settings, repeats);
}

std::vector<double> exact_events(const std::vector<double>& /*p*/, double t_end)
{
    std::vector<double> times;
    for (int n = 0; GrowDecay::switch_time(n) <= t_end; ++n) {
        times.push_back(GrowDecay::switch_time(n));
    }
    return times;
}

}  // namespace

SystemEntry grow_decay_entry()
{
    return {
        .name = GrowDecay::name,
        .description = "A quantity grows to 2 and decays to 1, in turn.",
        .parameters = {},
        .state = {{.name = "y", .unit = "1", .meaning = "quantity"}},
        .guards = labels(GrowDecay{}, {"full", "empty"}),
        .modes = mode_names<GrowDecay>(),
        .t_end = 10,
        .start = start,
        .run = run,
        .exact_events = exact_events,
        .any_parameters = false,
        .comparison_step = 0.1,
    };
}

}  // namespace ricochet::app
