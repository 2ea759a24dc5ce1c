#include "problems/super_twisting.hpp"

#include "entries.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { gain_1, gain_2, amplitude, frequency, x1, x2 };  // the order of parameters

SuperTwisting system(const std::vector<double>& p)
{
    return SuperTwisting({.gain_1 = p[gain_1],
                          .gain_2 = p[gain_2],
                          .amplitude = p[amplitude],
                          .frequency = p[frequency]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[x1], p[x2]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_inclusion(system(p), SuperTwisting::Vector(p[x1], p[x2]), settings, repeats);
}

}  // namespace

SystemEntry super_twisting_entry()
{
    return {
        .name = SuperTwisting::name,
        .description =
            "A continuous control with a relay in its integral holds a disturbed state at zero.",
        .source =
            "A. Levant, Sliding order and sliding accuracy in sliding mode control, "
            "International Journal of Control 58, 1993",
        .parameters =
            {{.name = "gain-1",
              .initial = 3,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "of the square root"},
             {.name = "gain-2",
              .initial = 2.2,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "of the relay"},
             {.name = "amplitude",
              .initial = 1,
              .unit = "1",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "of the disturbance"},
             {.name = "frequency",
              .initial = 1,
              .unit = "rad/s",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "of the disturbance"},
             {.name = "x1", .initial = 1, .unit = "1", .range = {}, .meaning = "at the start"},
             {.name = "x2", .initial = 0, .unit = "1", .range = {}, .meaning = "at the start"}},
        .state = {{.name = "x1", .unit = "1", .meaning = "the sliding variable"},
                  {.name = "x2", .unit = "1", .meaning = "integral part and disturbance"}},
        .guards = {{.name = "relay", .event = "switch"}},
        .modes = {"positive", "held", "negative", "set-valued"},
        .t_end = 10,
        .start = start,
        .run = run,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 0.005,
    };
}

}  // namespace ricochet::app
