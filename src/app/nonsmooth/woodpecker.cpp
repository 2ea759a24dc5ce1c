#include "ricochet/systems/woodpecker.hpp"

#include "complete.hpp"
#include "run_contact.hpp"

namespace ricochet::app {

namespace woodpecker {
namespace {

enum : std::size_t { friction, beak_restitution, spring, gravity };  // the order of parameters

Woodpecker system(const std::vector<double>& p)
{
    Woodpecker toy;
    toy.coefficient = p[friction];
    toy.beak_restitution = p[beak_restitution];
    toy.spring = p[spring];
    toy.gravity = p[gravity];
    return toy;
}

std::vector<double> start(const std::vector<double>& /*p*/)
{
    const auto q = Woodpecker::start();
    const auto v = Woodpecker::start_velocity();
    return {q[0], q[1], q[2], v[0], v[1], v[2]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_contact(system(settings.parameters), Woodpecker::start(),
                       Woodpecker::start_velocity(), settings, repeats);
}

}  // namespace
}  // namespace woodpecker

void complete_woodpecker(SystemEntry& entry)
{
    using namespace woodpecker;
    entry.start = start;
    entry.run = run;
}

}  // namespace ricochet::app
