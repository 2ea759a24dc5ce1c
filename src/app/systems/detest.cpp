// The discontinuous problems of the DETEST set.
#include <string_view>
#include <vector>

#include "entries.hpp"
#include "labels.hpp"
#include "problems/detest_f1.hpp"
#include "problems/detest_f2.hpp"
#include "problems/detest_f3.hpp"
#include "problems/detest_f4.hpp"
#include "problems/detest_f5.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

template <class Problem>
std::vector<double> start(const std::vector<double>& /*p*/)
{
    return {Problem::start.begin(), Problem::start.end()};
}

template <class Problem>
TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(Problem{}, start<Problem>(settings.parameters), settings, repeats);
}

template <class Problem>
SystemEntry entry(std::string_view description)
{
    SystemEntry out{
        .name = Problem::name,
        .description = description,
        .source =
            "W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial "
            "value methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to "
            "27",
        .parameters = {},
        .state = {{.name = "y", .unit = "1", .meaning = "value"}},
        .t_end = Problem::t_end,
        .start = start<Problem>,
        .run = run<Problem>,
        .series = has_series<Problem>,
    };
    if (Problem::start.size() == 2) {
        out.state.push_back({.name = "v", .unit = "1", .meaning = "rate"});
    }
    return out;
}

template <class Problem>
SystemEntry moded_entry(std::string_view description)
{
    SystemEntry out = entry<Problem>(description);
    out.modes = mode_names<Problem>();
    return out;
}

}  // namespace

SystemEntry detest_f1_entry()
{
    return moded_entry<DetestF1>("A growing oscillator under a square wave of one second.");
}

SystemEntry detest_f2_entry()
{
    return moded_entry<DetestF2>("A relaxation whose rate changes every second.");
}

SystemEntry detest_f3_entry()
{
    return entry<DetestF3>("Van der Pol's oscillator under a rectified sine.");
}

SystemEntry detest_f4_entry()
{
    return moded_entry<DetestF4>("A steep pulse, then a decay.");
}

SystemEntry detest_f5_entry()
{
    return entry<DetestF5>("A flow with a vertical tangent every second.");
}

}  // namespace ricochet::app
