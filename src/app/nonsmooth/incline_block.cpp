#include "problems/incline_block.hpp"

#include "complete.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace incline_block {
namespace {

enum : std::size_t { slope, friction, gravity, vx, vy };  // the order of parameters

InclineBlock system(const std::vector<double>& p)
{
    return InclineBlock({.slope = p[slope], .friction = p[friction], .gravity = p[gravity]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[vx], p[vy], 0, 0};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_inclusion(system(p), InclineBlock::Vector(p[vx], p[vy], 0, 0), settings, repeats);
}

}  // namespace
}  // namespace incline_block

void complete_incline_block(SystemEntry& entry)
{
    using namespace incline_block;
    entry.start = start;
    entry.run = run;
}

}  // namespace ricochet::app
