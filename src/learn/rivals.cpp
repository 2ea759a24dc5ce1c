#include "ricochet/learn/detail/rivals.hpp"
#include "limits.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace ricochet::learn {

namespace {

std::uint64_t lost(const Rival& rival, const Rival& exact)
{
    return exact.events - std::min(rival.events, exact.events);
}

/// The price of a call from which the network is the fastest, and its gain at the stated price.
std::string at_the_price(const GateReport& report)
{
    const std::vector<Rival>& rivals = report.trial.rivals;
    const double more = detail::winning_price(rivals);
    if (!std::isfinite(more)) return {};
    const double wins = report.guard_seconds + more;
    std::string out = more > 0 ? fmt::format(", that is from {:.2g} us on", 1e6 * wins)
                               : fmt::format("; a call of the guard took {:.2g} us", 1e6 * wins);
    if (!(report.price > report.guard_seconds)) return out;
    const auto cost = [&](const Rival& rival) {
        return rival.seconds +
               static_cast<double>(rival.guard_calls) * (report.price - report.guard_seconds);
    };
    double next = infinity;
    for (std::size_t i = 0; i + 1 < rivals.size(); ++i) {
        const bool equal = lost(rivals[i], rivals.front()) <= lost(rivals.back(), rivals.front());
        if (equal) next = std::min(next, cost(rivals[i]));
    }
    return out + fmt::format(
                     ", and with calls of {:.3g} us the network is {:.1f} times as fast as "
                     "the fastest other one",
                     1e6 * report.price, next / cost(rivals.back()));
}

}  // namespace

double detail::winning_price(const std::vector<Rival>& rivals)
{
    const Rival& network = rivals.back();
    double price = 0;
    for (const Rival& rival : rivals) {
        if (rival.seconds >= network.seconds ||
            lost(rival, rivals.front()) > lost(network, rivals.front())) {
            continue;
        }
        if (rival.guard_calls <= network.guard_calls) return infinity;
        const auto spared = static_cast<double>(rival.guard_calls - network.guard_calls);
        price = std::max(price, (network.seconds - rival.seconds) / spared);
    }
    return price;
}

TrainingEstimate detail::RunCost::for_events(std::uint64_t wanted,
                                             std::uint64_t most) const noexcept
{
    const auto n = static_cast<double>(std::max<std::uint64_t>(steps, 1));
    const double per_event = events > 0 ? n / static_cast<double>(events) : infinity;
    const double needed =
        std::min(per_event * static_cast<double>(wanted), static_cast<double>(most));
    return {
        .guard_calls = static_cast<std::uint64_t>(needed / n * static_cast<double>(guard_calls)),
        .seconds = needed / n * seconds,
        .events = wanted,
        .seen = events};
}

std::string describe(const TrainingEstimate& estimate)
{
    const std::string cost =
        fmt::format("{:.2g} guard calls, {:.2g} s", static_cast<double>(estimate.guard_calls),
                    estimate.seconds);
    if (estimate.seen == 0) {
        return fmt::format("no event in the first runs; up to {} if there is none", cost);
    }
    return fmt::format("about {} for the runs with {} events, and the training itself", cost,
                       estimate.events);
}

std::string describe(const std::vector<Rival>& rivals)
{
    if (rivals.size() < 2 || !(rivals.front().seconds > 0)) return {};
    const Rival& exact = rivals.front();
    const Rival& network = rivals.back();
    const auto share = [&](const Rival& rival) { return rival.seconds / exact.seconds; };
    const Rival* fastest = &network;
    std::size_t as_right = 0;
    for (const Rival& rival : rivals) {
        if (lost(rival, exact) > lost(network, exact)) continue;
        ++as_right;
        if (rival.seconds < fastest->seconds) fastest = &rival;
    }
    const bool wins = fastest == &network;
    std::string out = fmt::format(
        "the network is {}the fastest of {} ways to check that lose no more events: with the "
        "network a run takes {:.2f} of the time of checking every step with Extremum ({} of {} "
        "events lost)",
        wins ? "" : "not ", as_right, share(network), lost(network, exact), exact.events);
    if (wins) return out;
    out += fmt::format("; checking {} takes {:.2f} ({} of {} lost); ", fastest->name,
                       share(*fastest), lost(*fastest, exact), exact.events);
    const double price = detail::winning_price(rivals);
    return out + (std::isfinite(price)
                      ? fmt::format("the network is the fastest from a guard whose calls take "
                                    "{:.2g} us longer each",
                                    1e6 * price)
                      : std::string("at no price of the guard is the network the fastest, since "
                                    "it spares no calls"));
}

std::string GateReport::describe() const
{
    std::string out = learn::describe(trial.rivals);
    if (out.empty()) return out;
    if (guard_seconds > 0) out += at_the_price(*this);
    if (guard_calls == 0 || trial.exact_calls <= trial.gated_calls) return out;
    const auto spared = static_cast<double>(trial.exact_calls - trial.gated_calls);
    const double steps =
        static_cast<double>(guard_calls) / spared * static_cast<double>(trial.steps);
    const double events =
        steps * static_cast<double>(trial.events) / static_cast<double>(trial.steps);
    return out + fmt::format(
                     "; the {:.2g} guard calls of its training are saved after {:.2g} "
                     "steps, {:.2g} events",
                     static_cast<double>(guard_calls), steps, events);
}

}  // namespace ricochet::learn
