#include "problems/detest_f5.hpp"

#include "entries.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {DetestF5::start[0]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(DetestF5{}, start(settings.parameters), settings, repeats);
}

}  // namespace

SystemEntry detest_f5_entry()
{
    return {
        .name = DetestF5::name,
        .description = "A flow with a vertical tangent every second.",
        .source =
            "W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial "
            "value methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to "
            "27",
        .parameters = {},
        .state = {{.name = "y", .unit = "1", .meaning = "value"}},
        .t_end = DetestF5::t_end,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
