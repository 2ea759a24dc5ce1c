// Which way to look at a guard is fastest, by what the guard costs and how often it fires.
//
// A ball in a cavern whose guard is made dearer by waiting. Every way runs the same steps;
// the processor time of a run is measured with the guard as it is, and what dearer guards add
// is their number of calls times their price.
//
//     every      a look at every step
//     planned    bounds, and lower bounds where there is a table
//     every k    a look at every k-th step, with a way back; may miss
//
// With --gnuplot FILE a script is written that draws the table as a map.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/systems/cavern.hpp"
#include "scene_rows.hpp"

namespace {

using namespace ricochet;
using Fixed = FixedStep<Rk4>;

constexpr std::array<double, 7> prices{0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2};  // [s]
constexpr std::array<std::size_t, 3> strides{2, 10, 50};

struct Way {
    std::string name;
    double time = 0;   ///< [s] a step, with the guard as it is
    double calls = 0;  ///< exact, a step
    std::size_t events = 0;
    bool same = true;

    [[nodiscard]] double cost(double price) const { return time + calls * price; }
};

struct Regime {
    std::string name;
    double rate = 0;  ///< events per 1000 steps
    std::vector<Way> ways{};
};

template <class Detector>
Way measure(std::string name, const Cavern& system, const Options& options,
            const Detector& detector, std::uint64_t hash)
{
    const auto go = [&] { return integrate(system, system.start(), options, Fixed{}, detector); };
    const auto run = go();
    const auto steps = static_cast<double>(run.statistics.steps);
    const bench::Timing timing =
        bench::time_alone(bench::repeated(go), {.budget = 0.2, .fewest = 5});
    return {.name = std::move(name),
            .time = timing.median / steps,
            .calls = static_cast<double>(run.statistics.guard_calls) / steps,
            .events = run.events.size(),
            .same = hash == 0 || bench::hash_of(run) == hash};
}

Regime measure_regime(double kick, double step)
{
    const Cavern system({.segments = 1000, .kick = kick});
    const Options options{.t_end = 20'000 * step, .step = step};
    const auto exact = integrate(system, system.start(), options, Fixed{}, Extremum{});
    const std::uint64_t hash = bench::hash_of(exact);
    Regime regime{.name = fmt::format("kick {} m/s, step {} ms", kick, 1e3 * step),
                  .rate = 1e3 * static_cast<double>(exact.events.size()) /
                          static_cast<double>(exact.statistics.steps)};
    regime.ways.push_back(measure("every", system, options, Extremum{}, hash));
    regime.ways.push_back(measure("planned", system, options, bench::planner(), hash));
    for (const std::size_t k : strides) {
        regime.ways.push_back(
            measure(fmt::format("every {}", k), system, options, EveryK<>(k), hash));
    }
    return regime;
}

/// Of the ways that keep the events; the first where two are equal.
const Way& best(const Regime& regime, double price, bool only_same)
{
    const Way* found = nullptr;
    for (const Way& way : regime.ways) {
        if (only_same && !way.same) continue;
        if (found == nullptr || way.cost(price) < found->cost(price)) found = &way;
    }
    return *found;
}

std::string price_of(double price)
{
    return price == 0 ? "as it is" : fmt::format("+{:.6g} us", 1e6 * price);
}

void print(const std::vector<Regime>& regimes)
{
    fmt::print("{:<28}{:<10}{:>12}{:>12}{:>9}\n", "", "", "us a step", "calls/step", "events");
    for (const Regime& regime : regimes) {
        for (const Way& way : regime.ways) {
            fmt::print("{:<28}{:<10}{:>12.4f}{:>12.4f}{:>9}{}\n", regime.name, way.name,
                       1e6 * way.time, way.calls, way.events, way.same ? "" : "  other events");
        }
    }
    fmt::print(
        "\nThe fastest with the same events, and how many times faster than a look at "
        "every step; in brackets what is faster still and changes events.\n");
    fmt::print("{:<18}", "events/1000 steps");
    for (const double price : prices) fmt::print("{:>26}", price_of(price));
    fmt::print("\n");
    for (const Regime& regime : regimes) {
        fmt::print("{:<18.2f}", regime.rate);
        for (const double price : prices) {
            const Way& way = best(regime, price, true);
            const Way& any = best(regime, price, false);
            const double gain = regime.ways[0].cost(price) / way.cost(price);
            fmt::print("{:>26}", fmt::format("{} {:.1f}x{}", way.name, gain,
                                             any.same ? "" : fmt::format(" ({})", any.name)));
        }
        fmt::print("\n");
    }
}

/// Gain of the planner over a look at every step, over price and rate of events.
void write_plot(const std::string& file, const std::vector<Regime>& regimes)
{
    std::ofstream out(file);
    out << "set logscale xy\nset xlabel 'price of the guard [us]'\n"
           "set ylabel 'times faster than a look at every step'\nset key left top\n"
           "plot ";
    for (std::size_t i = 0; i < regimes.size(); ++i) {
        out << fmt::format("{}'-' with linespoints title '{:.2f} events per 1000 steps'",
                           i == 0 ? "" : ", ", regimes[i].rate);
    }
    out << ", 1 with lines dashtype 2 title 'every step'\n";
    for (const Regime& regime : regimes) {
        for (const double price : prices) {
            if (price == 0) continue;
            out << fmt::format("{:.6g} {:.6g}\n", 1e6 * price,
                               regime.ways[0].cost(price) / regime.ways[1].cost(price));
        }
        out << "e\n";
    }
    if (!out) throw std::runtime_error("cannot write " + file);
}

int run(int argc, char** argv)
{
    CLI::App app("Which way to look at a guard is fastest?");
    std::string file;
    app.add_option("--gnuplot", file, "also write a script for gnuplot -p");
    CLI11_PARSE(app, argc, argv);
    // Flying, skimming, and both with steps so long that hardly one lies between two events.
    const std::vector<Regime> regimes{measure_regime(6, 1e-3), measure_regime(0.5, 1e-3),
                                      measure_regime(6, 1e-2), measure_regime(0.5, 1e-2),
                                      measure_regime(0.5, 5e-2)};
    print(regimes);
    if (!file.empty()) write_plot(file, regimes);
    return 0;
}

}  // namespace

int main(int argc, char** argv)
{
    try {
        return run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "ricochet_crossover: {}\n", error.what());
        return 2;
    }
}
