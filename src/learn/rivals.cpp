#include "ricochet/detail/rivals.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ricochet::learn {

namespace {

std::string lost(const Rival& rival, const Rival& exact)
{
    if (rival.events >= exact.events) return "no event lost";
    return fmt::format("{} of {} events lost", exact.events - rival.events, exact.events);
}

}  // namespace

std::string describe(const std::vector<Rival>& rivals)
{
    if (rivals.size() < 2 || !(rivals.front().seconds > 0)) return {};
    const Rival& exact = rivals.front();
    const Rival& network = rivals.back();
    const auto share = [&](const Rival& rival) { return rival.seconds / exact.seconds; };
    const Rival& fastest =
        *std::min_element(rivals.begin(), rivals.end(),
                          [](const Rival& a, const Rival& b) { return a.seconds < b.seconds; });
    if (&fastest == &network) {
        return fmt::format(
            "the network is the fastest of {} ways to check: {:.2f} of the time of "
            "every step, {}",
            rivals.size(), share(network), lost(network, exact));
    }
    return fmt::format(
        "the network is not the fastest of {} ways to check: it takes {:.2f} of the time of every "
        "step ({}), looking at {} takes {:.2f} ({})",
        rivals.size(), share(network), lost(network, exact), fastest.name, share(fastest),
        lost(fastest, exact));
}

}  // namespace ricochet::learn
