// Which way of checking a guard is fastest, depending on the cost of the guard, how often it fires
// and the number of components that it depends on.
//
// The guards of several scenes are made more expensive. All detectors run the same steps. The
// processor time of a run is measured with the guard as it is; a more expensive guard adds its
// number of calls times the additional price.
//
//     every step  a check at every step
//     planned     bounds, and lower bounds where there is a table
//     every k     a check at every k-th step, with rollback; may miss events
//     network     a gate for a guard of which only the sign is known; may miss events
//
// With --plot FILE.svg a map of the fastest detectors is written, with --gnuplot FILE a script that
// draws the planner's gain. --networks also trains gates, which takes some minutes.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "crossover.hpp"

namespace ricochet::bench {

const Way& best_way(const Regime& regime, double price, bool only_same)
{
    const Way* found = nullptr;
    for (const Way& way : regime.ways) {
        if (only_same && !way.same) continue;
        if (found == nullptr || way.cost(price) < found->cost(price)) found = &way;
    }
    return *found;
}

namespace {

const std::vector<double> prices{0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2};  // [s]

std::string price_of(double price)
{
    return price == 0 ? "as it is" : fmt::format("+{:.6g} us", 1e6 * price);
}

void print(const std::vector<Regime>& regimes)
{
    fmt::print("{:<32}{:<12}{:>12}{:>12}{:>9}\n", "", "", "us a step", "calls/step", "events");
    for (const Regime& regime : regimes) {
        for (const Way& way : regime.ways) {
            fmt::print("{:<32}{:<12}{:>12.4f}{:>12.4f}{:>9}{}\n", regime.name, way.name,
                       1e6 * way.time, way.calls, way.events, way.same ? "" : "  other events");
        }
    }
    fmt::print(
        "\nThe fastest with the same events, and how many times faster than a look at "
        "every step; in brackets what is faster still and changes events.\n");
    fmt::print("{:<34}{:>4}{:>8}", "", "dim", "events");
    for (const double price : prices) fmt::print("{:>26}", price_of(price));
    fmt::print("\n");
    for (const Regime& regime : regimes) {
        fmt::print("{:<34}{:>4}{:>8.2f}", regime.name + (regime.opaque ? ", sign" : ""),
                   regime.dimension, regime.rate);
        for (const double price : prices) {
            const Way& way = best_way(regime, price, true);
            const Way& any = best_way(regime, price, false);
            const double gain = regime.ways[0].cost(price) / way.cost(price);
            fmt::print("{:>26}", fmt::format("{} {:.1f}x{}", way.name, gain,
                                             any.same ? "" : fmt::format(" ({})", any.name)));
        }
        fmt::print("\n");
    }
}

/// Gain of the planner over a check at every step, by price and rate of events.
void write_plot(const std::string& file, const std::vector<Regime>& regimes)
{
    std::ofstream out(file);
    out << "set logscale xy\nset xlabel 'price of the guard [us]'\n"
           "set ylabel 'times faster than a look at every step'\nset key left top\n"
           "plot ";
    for (std::size_t i = 0; i < regimes.size(); ++i) {
        out << fmt::format(
            "{}'-' with linespoints title '{} components, {:.2f} events per 1000 steps'",
            i == 0 ? "" : ", ", regimes[i].dimension, regimes[i].rate);
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
    CLI::App app("Which way to look at a guard is fastest?", "ricochet_crossover");
    std::string script;
    std::string map;
    bool networks = false;
    app.add_option("--plot", map, "also write a map, as SVG");
    app.add_option("--gnuplot", script, "also write a script for gnuplot -p");
    app.add_flag("--networks", networks, "also train gates where only the sign is known");
    CLI11_PARSE(app, argc, argv);
    std::vector<Regime> regimes = bounded_regimes();
    if (!script.empty()) write_plot(script, regimes);
    if (networks) {
        for (Regime& regime : opaque_regimes()) regimes.push_back(std::move(regime));
    }
    print(regimes);
    if (!map.empty()) write_map(map, regimes, prices);
    return 0;
}

}  // namespace
}  // namespace ricochet::bench

int main(int argc, char** argv)
{
    try {
        return ricochet::bench::run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "ricochet_crossover: {}\n", error.what());
        return 2;
    }
}
