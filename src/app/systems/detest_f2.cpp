#include "problems/detest_f2.hpp"

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {DetestF2::start[0]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(DetestF2{}, start(settings.parameters), settings, repeats);
}

}  // namespace

SystemEntry detest_f2_entry()
{
    return {
        .name = DetestF2::name,
        .description = "A relaxation whose rate changes every second.",
        .source =
            "W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial "
            "value methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to "
            "27",
        .parameters = {},
        .state = {{.name = "y", .unit = "1", .meaning = "value"}},
        .modes = mode_names<DetestF2>(),
        .t_end = DetestF2::t_end,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
