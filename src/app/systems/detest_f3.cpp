#include "problems/detest_f3.hpp"

#include "entries.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {DetestF3::start[0], DetestF3::start[1]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(DetestF3{}, start(settings.parameters), settings, repeats);
}

}  // namespace

SystemEntry detest_f3_entry()
{
    return {
        .name = DetestF3::name,
        .description = "Van der Pol's oscillator under a rectified sine.",
        .source =
            "W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial "
            "value methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to "
            "27",
        .parameters = {},
        .state = {{.name = "y", .unit = "1", .meaning = "value"},
                  {.name = "v", .unit = "1", .meaning = "rate"}},
        .t_end = DetestF3::t_end,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
