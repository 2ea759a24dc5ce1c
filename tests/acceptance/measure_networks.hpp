// Checks of every scene with an expensive guard: networks with any weights are attached, and
// the events and times compared with those of runs without.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "measure.hpp"
#include "ricochet/detect/gates.hpp"
#include "scene_rows.hpp"
#include "timing.hpp"

namespace ricochet::bench {

struct AnyGate {
    std::string name;
    gates::Gate gate;
};
struct AnyNetwork {
    std::string name;
    Network network;
};

/// Small gates that clear everything, nothing, or an arbitrary set of states.
[[nodiscard]] std::vector<AnyGate> odd_gates(std::string_view system, std::size_t inputs,
                                             double step);
/// Gates that cost some 0.2 us per answer, and know nothing.
[[nodiscard]] std::vector<AnyGate> expensive_gates(std::string_view system, std::size_t inputs,
                                                   double step);
/// Predictions for one step.
[[nodiscard]] std::vector<AnyNetwork> odd_networks(std::string_view system, std::size_t inputs);

/// A scene with all of these networks, one at a time.
struct SameEvents {
    std::string name;
    std::uint64_t events = 0;
    std::size_t runs = 0;
    std::uint64_t answers = 0;
    std::string different{};  ///< networks under which events differ
};

// Rivals are compiled in the same way: in one function each, and with a type local to this source.
// The time of a loop changes by up to an eighth if it is inlined in one place and called elsewhere,
// or linked from the object file of another source.
namespace {

template <class System>
struct Alone : System {
    explicit Alone(const System& system) : System(system) {}
};

}  // namespace

template <class Stepping, class System, class Detector>
[[gnu::noinline]] auto run_with(const System& system, const Options& options,
                                const Detector& detector)
{
    return integrate(system, system.start(), options, Stepping{}, detector);
}

template <class Stepping, class System, class Detector>
void compare_events(SameEvents& scene, const System& system, const Options& options,
                    std::uint64_t exact, const std::string& network, const Detector& detector)
{
    const auto run = run_with<Stepping>(system, options, detector);
    ++scene.runs;
    scene.answers += run.statistics.network_calls;
    if (hash_of(run) != exact) scene.different += network + "; ";
}

/// Steps have a length of about `step` [s].
template <class Stepping, class System>
[[nodiscard]] SameEvents same_events(std::string name, std::string_view known_as,
                                     const System& system, const Options& options, double step)
{
    using X = typename System::State;
    const std::size_t inputs = system.start().size();
    const auto exact = run_with<Stepping>(system, options, Extremum{});
    const std::uint64_t hash = hash_of(exact);
    SameEvents scene{.name = std::move(name), .events = exact.statistics.events};
    if constexpr (Bounded<System, X>) {
        const PlannerOptions planning{.check_bounds = false};
        for (const AnyGate& any : odd_gates(known_as, inputs, step)) {
            const Foreseen<> detector(any.gate, planning);
            compare_events<Stepping>(scene, system, options, hash, any.name, detector);
            if (any.name != "bold") continue;
            compare_events<Stepping>(scene, system, options, hash, any.name + ", metered",
                                     Metered(detector));
        }
    } else {
        for (const AnyNetwork& any : odd_networks(known_as, inputs)) {
            compare_events<Stepping>(scene, system, options, hash, any.name,
                                     Verified<>(any.network));
        }
    }
    return scene;
}

/// Times [s] of a run.
struct MeteredRow {
    std::string name;
    std::string network;
    std::uint64_t steps = 0;
    std::uint64_t asked = 0;
    double every = 0;
    double planned = 0;
    double metered = 0;
    bool same = false;  ///< events

    [[nodiscard]] double ratio() const { return metered / std::min(every, planned); }
};

/// Two rows: gates that know nothing, and one that predicts too far ahead. The least disturbed
/// tenth of the samples counts. A check of every step is timed in turns with the others unless it
/// takes so long that the comparison is meaningless.
template <class Stepping, class System>
void time_metered(std::vector<MeteredRow>& rows, const std::string& name, const System& of,
                  const Options& options, double step, double budget)
{
    const Alone<System> system(of);
    const auto run = [&](const auto& detector) {
        return run_with<Stepping>(system, options, detector);
    };
    const std::vector<AnyGate> gates = expensive_gates(system.name, system.start().size(), step);
    const PlannerOptions planning{.check_bounds = false};
    const std::array<Metered<Foreseen<>>, 2> metered{Metered(Foreseen<>(gates[0].gate, planning)),
                                                     Metered(Foreseen<>(gates[1].gate, planning))};
    const auto exact = run(Extremum{});
    const Work every = repeated([&] { return run(Extremum{}); });
    const Timing roughly = time_alone(every, {.budget = 0, .fewest = 1});
    std::vector<Work> works{repeated([&] { return run(planner()); }),
                            repeated([&] { return run(metered[0]); }),
                            repeated([&] { return run(metered[1]); })};
    const bool close = roughly.p10 < 3 * time_alone(works[0], {.budget = 0, .fewest = 1}).p10;
    if (close) works.push_back(every);
    const auto timings = time_in_turns(works, {.budget = budget, .fewest = 15});
    for (std::size_t k = 0; k < 2; ++k) {
        const auto once = run(metered[k]);
        rows.push_back({.name = name,
                        .network = gates[k].name,
                        .steps = exact.statistics.steps,
                        .asked = once.statistics.network_calls,
                        .every = close ? timings[3].p10 : roughly.p10,
                        .planned = timings[0].p10,
                        .metered = timings[1 + k].p10,
                        .same = hash_of(once) == hash_of(exact)});
    }
}

void add_cavern_events(std::vector<SameEvents>& scenes);
void add_cave_body_events(std::vector<SameEvents>& scenes);
void add_arm_events(std::vector<SameEvents>& scenes);
void add_other_events(std::vector<SameEvents>& scenes);

void add_cavern_times(std::vector<MeteredRow>& rows);
void add_cave_body_times(std::vector<MeteredRow>& rows);
void add_arm_times(std::vector<MeteredRow>& rows);
void add_other_times(std::vector<MeteredRow>& rows);

}  // namespace ricochet::bench
