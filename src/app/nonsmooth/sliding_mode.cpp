#include "ricochet/systems/sliding_mode.hpp"

#include "complete.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace sliding_mode {
namespace {

enum : std::size_t { amplitude, frequency, gain, from };  // the order of parameters

SlidingMode system(const std::vector<double>& p)
{
    return SlidingMode({.amplitude = p[amplitude], .frequency = p[frequency], .gain = p[gain]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[from]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_inclusion<Fehlberg78>(
        system(p), SlidingMode::Vector(SlidingMode::Vector::Constant(p[from])), settings, repeats);
}

std::vector<double> exact_state(const std::vector<double>& p, double t)
{
    if (!(p[from] > 0 && p[gain] > p[amplitude])) return {};
    return {system(p).exact(t, p[from])};
}

}  // namespace
}  // namespace sliding_mode

void complete_sliding_mode(SystemEntry& entry)
{
    using namespace sliding_mode;
    entry.start = start;
    entry.run = run;
    entry.exact_state = exact_state;
}

}  // namespace ricochet::app
