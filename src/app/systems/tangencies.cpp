// Guards that barely pass their surfaces.
#include "entries.hpp"
#include "labels.hpp"
#include "problems/grow_decay.hpp"
#include "problems/hidden_pair.hpp"
#include "problems/near_tangent.hpp"
#include "run_system.hpp"

namespace ricochet::app {

// --- near tangent ---

namespace near_tangent {
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
}  // namespace near_tangent

SystemEntry near_tangent_entry()
{
    using namespace near_tangent;
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
        .series = has_series<NearTangent>,
        .exact_events = exact_events,
        .comparison_step = 0.05,
    };
}

// --- hidden pair ---

namespace hidden_pair {
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
}  // namespace hidden_pair

SystemEntry hidden_pair_entry()
{
    using namespace hidden_pair;
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
        .series = has_series<HiddenPair>,
        .exact_events = exact_events,
        .any_parameters = false,
        .comparison_step = 0.1,
    };
}

// --- grow decay ---

namespace grow_decay {
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
}  // namespace grow_decay

SystemEntry grow_decay_entry()
{
    using namespace grow_decay;
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
        .series = has_series<GrowDecay>,
        .exact_events = exact_events,
        .any_parameters = false,
        .comparison_step = 0.1,
    };
}

}  // namespace ricochet::app
