#include "problems/rolling_ball.hpp"

#include "complete.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace rolling_ball {
namespace {

enum : std::size_t {
    mass,
    radius,
    friction,
    resistance,
    plate_speed,
    plate_frequency,
    gravity,
    velocity,
    spin
};  // the order of parameters

RollingBall system(const std::vector<double>& p)
{
    return RollingBall({.mass = p[mass],
                        .radius = p[radius],
                        .friction = p[friction],
                        .resistance = p[resistance],
                        .plate_speed = p[plate_speed],
                        .plate_frequency = p[plate_frequency],
                        .gravity = p[gravity]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[velocity], p[spin]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_inclusion(system(p), RollingBall::Vector(p[velocity], p[spin]), settings, repeats);
}

}  // namespace
}  // namespace rolling_ball

void complete_rolling_ball(SystemEntry& entry)
{
    using namespace rolling_ball;
    entry.start = start;
    entry.run = run;
}

}  // namespace ricochet::app
