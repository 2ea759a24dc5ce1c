#include "problems/near_tangent.hpp"

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { depth, phase, touch };  // the order of parameters

NearTangent system(const std::vector<double>& p)
{
    return NearTangent({.depth = p[depth], .phase = p[phase], .touch = p[touch]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {system(p).start()[0], system(p).start()[1]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

std::vector<double> exact_events(const std::vector<double>& p, double t_end)
{
    return system(p).events(t_end);
}

}  // namespace

SystemEntry near_tangent_entry()
{
    return {
        .name = NearTangent::name,
        .description =
            "A cosine barely passes a level, touches it or misses it; with depth=0, set "
            "touch above the errors of the run (1e-6) to have its touches found.",
        .parameters =
            {{.name = "depth",
              .initial = 1e-4,
              .unit = "1",
              .range = {.upper = 2},
              .meaning = "of the level below the crest; negative: above"},
             {.name = "phase", .initial = 1, .unit = "rad", .range = {}, .meaning = "at the start"},
             {.name = "touch",
              .initial = 0,
              .unit = "1",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "largest distance between crest and level that is a touch"}},
        .state = {{.name = "y", .unit = "1", .meaning = "value"},
                  {.name = "v", .unit = "1", .meaning = "rate"}},
        .guards = labels(NearTangent{}, {"passage"}),
        .t_end = 20,
        .start = start,
        .run = run,
        .exact_events = exact_events,
        .comparison_step = 0.05,
    };
}

}  // namespace ricochet::app
