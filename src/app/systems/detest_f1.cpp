#include "problems/detest_f1.hpp"

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {DetestF1::start[0], DetestF1::start[1]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(DetestF1{}, start(settings.parameters), settings, repeats);
}

}  // namespace

SystemEntry detest_f1_entry()
{
    return {
        .name = DetestF1::name,
        .description = "A growing oscillator under a square wave of one second.",
        .source =
            "W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial "
            "value methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to "
            "27",
        .parameters = {},
        .state = {{.name = "y", .unit = "1", .meaning = "value"},
                  {.name = "v", .unit = "1", .meaning = "rate"}},
        .modes = mode_names<DetestF1>(),
        .t_end = DetestF1::t_end,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
