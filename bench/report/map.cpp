// Which way to check a guard is fastest, by what is known of the guard, how often it fires and
// what it costs: the figures of the map in the report.
//
//     ricochet_map > map.json
//
// A ball in a cavern of 10 000 segments, whose wall is known in four degrees: the value of the
// guard alone; value and rate; these and bounds; the sign alone. The length of the steps determines
// how many events there are per step. Ways:
//
//     every step   the exact detector at every step, with which the others are compared; without
//     the
//                  tree of segments, too
//     every k      at every k-th step, with rollback; may miss events
//     planned      bounds and a table of lower bounds
//     verified     the planner with a horizon gate as its forecast; keeps events
//     certified    the planner with levels that a network clears, proved here; keeps events
//     calibrated   a horizon gate without verification; may miss events
//
// All ways of checking a guard run the same steps, and are timed in turns. An expensive guard adds
// its number of calls times its price. Gates are trained here on the sign alone, one for each
// length of the steps.
#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <exception>
#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "certificates.hpp"
#include "crossover.hpp"
#include "problems/cavern.hpp"
#include "problems/opaque.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/learn/train.hpp"

namespace ricochet::bench {

namespace {

using Json = nlohmann::json;
using Stepping = FixedStep<Rk4>;
using X = Cavern::State;

constexpr double step_lengths[] = {1e-3, 4e-3, 1.6e-2, 6.4e-2};  ///< [s]
/// [s] Nearly every state has an event within a longer time.
constexpr double longest_horizon = 0.5;
constexpr double steps_of_run = 40'000;

/// A system that exposes the value and the rate of the guard, but no bounds.
class WithRate : public Hidden<Cavern> {
public:
    using Hidden<Cavern>::Hidden;

    template <class State, class D>
    [[nodiscard]] double guard_rate(double t, const State& x, const D& dxdt) const noexcept
    {
        return system().guard_rate(t, x, dxdt);
    }
};

/// One way of checking a guard, and the measurements of one of its runs.
struct Contender {
    struct Result {
        std::uint64_t hash, steps, calls, events;
    };
    std::string name;
    std::function<Result()> run;
};

template <class System, class Detector>
[[nodiscard]] Contender contender(std::string name, const System& system, double step,
                                  const Detector& detector)
{
    return {std::move(name), [=] {
                const Options options{.t_end = steps_of_run * step, .step = step};
                const auto run = integrate(system, system.start(), options, Stepping{}, detector);
                return Contender::Result{hash_of(run), run.statistics.steps,
                                         run.statistics.guard_calls, run.events.size()};
            }};
}

/// The first contender is a check at every step.
[[nodiscard]] Json race(const std::vector<Contender>& contenders)
{
    std::vector<Work> works;
    std::vector<Contender::Result> results;
    for (const Contender& one : contenders) {
        results.push_back(one.run());
        works.push_back(repeated(one.run));
    }
    const std::vector<Timing> timings = time_in_turns(works, {.budget = 0.1, .fewest = 5});
    Json ways = Json::array();
    for (std::size_t i = 0; i < contenders.size(); ++i) {
        const auto steps = static_cast<double>(results[i].steps);
        ways.push_back({{"name", contenders[i].name},
                        {"time", timings[i].p10 / steps},
                        {"calls", static_cast<double>(results[i].calls) / steps},
                        {"events", results[i].events},
                        {"same", results[i].hash == results[0].hash}});
    }
    return {{"rate",
             1e3 * static_cast<double>(results[0].events) / static_cast<double>(results[0].steps)},
            {"ways", ways}};
}

/// Ways that use only the sign.
template <class System>
[[nodiscard]] std::vector<Contender> without_bounds(const System& system, double step,
                                                    const Model& gate)
{
    std::vector<Contender> out{contender("every step", system, step, Extremum{})};
    for (const std::size_t k : {2U, 10U, 50U}) {
        out.push_back(contender("every " + std::to_string(k), system, step, EveryK<>(k)));
    }
    out.push_back(contender("calibrated", system, step, Calibrated<>(gates::Gate(gate))));
    return out;
}

[[nodiscard]] Model train_gate_for(const Cavern& cavern, double step)
{
    const BlackBox<Cavern> system(cavern, 0);
    const X start = system.start();
    const learn::Starts<X> starts = [start](learn::Random& random) {
        return learn::RunStart<X>{.t = random.uniform(0, 1e4), .x = start};
    };
    learn::GateTraining training;
    training.recipe = gate_recipe("state");
    for (const std::size_t k : {2U, 4U, 8U, 16U, 32U, 64U}) {
        if (k > 2 && static_cast<double>(k) * step > longest_horizon) break;
        training.levels.push_back(learn::horizons(step, {k}).front());
    }
    training.step_min = training.step_max = step;
    training.run_length = 2e4 * step;
    training.hidden = {32, 32};
    training.events = 1500;
    training.states = 60'000;
    training.validation_events = 750;
    training.iterations = 1000;
    training.fresh_events = 0;
    return learn::train_gate(system, starts, Stepping{}, {}, training).model;
}

[[nodiscard]] double seconds_since(std::chrono::steady_clock::time_point start)
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

[[nodiscard]] Json map()
{
    const auto start = std::chrono::steady_clock::now();
    const Cavern cavern;
    const Cavern brute({.search = Cavern::Search::brute});
    const Hidden<Cavern> hidden(cavern);
    const WithRate with_rate(cavern);
    const BlackBox<Cavern> black_box(cavern, 0);
    const PlannerOptions planning{.check_bounds = false};
    const Model proved = certified_network("cavern", 2000, {.levels = 4, .threads = 1});
    const double proof_seconds = seconds_since(start);
    double training_seconds = 0;
    Json value{{"known", "value"}, {"rows", Json::array()}};
    Json rate{{"known", "value and rate"}, {"rows", Json::array()}};
    Json bounds{{"known", "value, rate and bounds"}, {"rows", Json::array()}};
    Json sign{{"known", "sign"}, {"rows", Json::array()}};
    for (const double step : step_lengths) {
        const auto begin = std::chrono::steady_clock::now();
        const Model gate = train_gate_for(cavern, step);
        Model named = gate;  // for the cavern itself, which has a name
        named.system = Cavern::name;
        training_seconds += seconds_since(begin);
        value["rows"].push_back(race(without_bounds(hidden, step, gate)));
        rate["rows"].push_back(race(without_bounds(with_rate, step, gate)));
        sign["rows"].push_back(race(without_bounds(black_box, step, gate)));
        std::vector<Contender> all = without_bounds(cavern, step, named);
        all.push_back(contender("every segment at every step", brute, step, Extremum{}));
        all.push_back(contender("planned", cavern, step, planner()));
        all.push_back(
            contender("verified", cavern, step, Foreseen<>(gates::Gate(named), planning)));
        all.push_back(contender("certified", cavern, step, Certified<>(proved, planning)));
        bounds["rows"].push_back(race(all));
        fmt::print(stderr, "steps of {:g} s: {:.0f} s\n", step, seconds_since(start));
    }
    return {{"panels", {value, rate, bounds, sign}},
            {"proof_seconds", proof_seconds},
            {"training_seconds", training_seconds},
            {"seconds", seconds_since(start)}};
}

}  // namespace

}  // namespace ricochet::bench

int main()
{
    try {
        std::cout << ricochet::bench::map() << '\n';
        return 0;
    } catch (const std::exception& error) {
        fmt::print(stderr, "ricochet_map: {}\n", error.what());
        return 1;
    }
}
