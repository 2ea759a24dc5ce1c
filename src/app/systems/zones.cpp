#include "problems/zones.hpp"

#include <array>
#include <string>

#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { seed, size, frequency, turn };  // the order of parameters

Zones system(const std::vector<double>& p)
{
    return Zones({.seed = static_cast<std::uint64_t>(p[seed]),
                  .size = p[size],
                  .frequency = p[frequency],
                  .turn = p[turn]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[size], p[size], 0, 0};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

std::vector<GuardLabel> zone_labels()
{
    static const std::vector<std::string> names = [] {
        std::vector<std::string> out;
        for (std::size_t i = 0; i < Zones::Parameters{}.count; ++i) {
            out.push_back("zone-" + std::to_string(i));
        }
        return out;
    }();
    std::vector<GuardLabel> out;
    for (const std::string& name : names) out.push_back({name, "edge"});
    return out;
}

}  // namespace

SystemEntry zones_entry()
{
    const Zones::Parameters d;
    const Range positive{.lower = 0};
    const Range not_negative{.lower = 0, .lower_included = true};
    return {
        .name = Zones::name,
        .description = "A point on two springs enters and leaves 256 turning zones.",
        .parameters = {{"seed", static_cast<double>(d.seed), "1", not_negative, "of the zones"},
                       {"size", d.size, "m", positive, "half the side of the field"},
                       {"frequency", d.frequency, "rad/s", positive, "of the slower spring"},
                       {"turn", d.turn, "rad/s", not_negative, "of the fastest zone"}},
        .state = {{"x", "m", "position"},
                  {"y", "m", "position"},
                  {"vx", "m/s", "rate of x"},
                  {"vy", "m/s", "rate of y"}},
        .guards = zone_labels(),
        .t_end = 20,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
