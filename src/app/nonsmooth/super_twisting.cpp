#include "problems/super_twisting.hpp"

#include "complete.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace super_twisting {
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
}  // namespace super_twisting

void complete_super_twisting(SystemEntry& entry)
{
    using namespace super_twisting;
    entry.start = start;
    entry.run = run;
}

}  // namespace ricochet::app
