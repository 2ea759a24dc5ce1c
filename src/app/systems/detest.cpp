// The discontinuous problems of the DETEST set.
#include "entries.hpp"
#include "labels.hpp"
#include "problems/detest_f1.hpp"
#include "problems/detest_f2.hpp"
#include "problems/detest_f3.hpp"
#include "problems/detest_f4.hpp"
#include "problems/detest_f5.hpp"
#include "run_system.hpp"

namespace ricochet::app {

// --- detest f1 ---

namespace detest_f1 {
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
}  // namespace detest_f1

SystemEntry detest_f1_entry()
{
    using namespace detest_f1;
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

// --- detest f2 ---

namespace detest_f2 {
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
}  // namespace detest_f2

SystemEntry detest_f2_entry()
{
    using namespace detest_f2;
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

// --- detest f3 ---

namespace detest_f3 {
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
}  // namespace detest_f3

SystemEntry detest_f3_entry()
{
    using namespace detest_f3;
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

// --- detest f4 ---

namespace detest_f4 {
namespace {

std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {DetestF4::start[0]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(DetestF4{}, start(settings.parameters), settings, repeats);
}

}  // namespace
}  // namespace detest_f4

SystemEntry detest_f4_entry()
{
    using namespace detest_f4;
    return {
        .name = DetestF4::name,
        .description = "A steep pulse, then a decay.",
        .source =
            "W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial "
            "value methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to "
            "27",
        .parameters = {},
        .state = {{.name = "y", .unit = "1", .meaning = "value"}},
        .modes = mode_names<DetestF4>(),
        .t_end = DetestF4::t_end,
        .start = start,
        .run = run,
    };
}

// --- detest f5 ---

namespace detest_f5 {
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
}  // namespace detest_f5

SystemEntry detest_f5_entry()
{
    using namespace detest_f5;
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
