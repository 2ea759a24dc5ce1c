// Ways of checking a guard, and their cost as a function of the price of the guard.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "scene_rows.hpp"

namespace ricochet::bench {

/// One way of checking a guard, measured on one run.
struct Way {
    std::string name;
    double time = 0;   ///< [s] a step, with the guard as it is
    double calls = 0;  ///< exact calls per step
    std::size_t events = 0;
    bool same = true;  ///< same events as with a check at every step

    /// [s] per step with a guard that is more expensive by `price` [s].
    [[nodiscard]] double cost(double price) const { return time + calls * price; }
};

/// A scene at one rate of events; the first way is a check at every step.
struct Regime {
    std::string name;
    std::size_t dimension = 0;  ///< components that the guard depends on
    bool opaque = false;        ///< only the sign of the guard is known
    double rate = 0;            ///< events per 1000 steps
    std::vector<Way> ways{};
};

template <class System, class Detector>
[[nodiscard]] Way measure_way(std::string name, const System& system,
                              const typename System::State& x0, const Options& options,
                              const Detector& detector, std::uint64_t hash)
{
    const auto go = [&] { return integrate(system, x0, options, FixedStep<Rk4>{}, detector); };
    const auto run = go();
    const auto steps = static_cast<double>(run.statistics.steps);
    const Timing timing = time_alone(repeated(go), {.budget = 0.1, .fewest = 3});
    return {.name = std::move(name),
            .time = timing.median / steps,
            .calls = static_cast<double>(run.statistics.guard_calls) / steps,
            .events = run.events.size(),
            .same = hash == 0 || hash_of(run) == hash};
}

/// A check at every step and at every k-th; the caller adds other detectors.
template <class System>
[[nodiscard]] Regime plain_regime(std::string name, std::size_t dimension, const System& system,
                                  const Options& options, std::uint64_t& hash)
{
    const auto x0 = system.start();
    const auto exact = integrate(system, x0, options, FixedStep<Rk4>{}, Extremum{});
    hash = hash_of(exact);
    Regime regime{.name = std::move(name),
                  .dimension = dimension,
                  .rate = 1e3 * static_cast<double>(exact.events.size()) /
                          static_cast<double>(exact.statistics.steps)};
    regime.ways.push_back(measure_way("every step", system, x0, options, Extremum{}, hash));
    for (const std::size_t k : {2U, 10U, 50U}) {
        regime.ways.push_back(
            measure_way("every " + std::to_string(k), system, x0, options, EveryK<>(k), hash));
    }
    return regime;
}

/// Guards with declared bounds, of 2, 4 and 6 components: balls in caverns and arms.
[[nodiscard]] std::vector<Regime> bounded_regimes();

/// The same scenes behind black boxes, and gates that are trained here on their runs.
[[nodiscard]] std::vector<Regime> opaque_regimes();

/// Writes a map of the fastest way by price and rate for every dimension.
/// @throws std::runtime_error if the file cannot be written.
void write_map(const std::string& file, const std::vector<Regime>& regimes,
               const std::vector<double>& prices);

/// The cheapest of all ways, or of those that keep the events; of equal ones the first.
[[nodiscard]] const Way& best_way(const Regime& regime, double price, bool only_same);

}  // namespace ricochet::bench
