#include "ricochet/systems/two_contact_block.hpp"

#include "complete.hpp"
#include "run_contact.hpp"

namespace ricochet::app {

namespace two_contact_block {
namespace {

enum : std::size_t {
    mass,
    half_width,
    half_height,
    gravity,
    friction,
    restitution,
    height,
    tilt,
    velocity
};  // the order of parameters

TwoContactBlock system(const std::vector<double>& p)
{
    return {.mass_of_block = p[mass],
            .half_width = p[half_width],
            .half_height = p[half_height],
            .gravity = p[gravity],
            .coefficient = p[friction],
            .bounce = p[restitution]};
}

std::vector<double> start(const std::vector<double>& p)
{
    return {0, p[height], p[tilt], p[velocity], 0, 0};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_contact(system(p), TwoContactBlock::Vector(0, p[height], p[tilt]),
                       TwoContactBlock::Vector(p[velocity], 0, 0), settings, repeats);
}

}  // namespace
}  // namespace two_contact_block

void complete_two_contact_block(SystemEntry& entry)
{
    using namespace two_contact_block;
    entry.start = start;
    entry.run = run;
}

}  // namespace ricochet::app
