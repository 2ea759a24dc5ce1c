#include "problems/hidden_pair.hpp"

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {HiddenPair::start[0]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(HiddenPair{}, start(settings.parameters), settings, repeats);
}

std::vector<double> exact_events(const std::vector<double>& /*p*/, double t_end)
{
    std::vector<double> times;
    for (const double t : HiddenPair::zeros) {
        if (t <= t_end) times.push_back(t);
    }
    return times;
}

}  // namespace

SystemEntry hidden_pair_entry()
{
    return {
        .name = HiddenPair::name,
        .description =
            "A cubic in time as the solution of a differential equation; its three zeros are "
            "found.",
        .parameters = {},
        .state = {{.name = "y", .unit = "1", .meaning = "value"}},
        .guards = labels(HiddenPair{}, {"zero"}),
        .t_start = HiddenPair::t_start,
        .t_end = HiddenPair::t_end,
        .start = start,
        .run = run,
        .exact_events = exact_events,
        .any_parameters = false,
        .comparison_step = 0.1,
    };
}

}  // namespace ricochet::app
