// A guard with thin targets, by every way of checking it: posts that a mass passes in a few steps,
// once in about two thousand.
//
//     ricochet_posts                  the table, with models/posts-gate.safetensors
//     ricochet_posts --train FILE     trains that gate, from seed 1; some minutes
//
// Every way makes the same flights, from random starts to the first event. An event is lost where
// it is not found within a step of the time at which checks of the ends of all steps find it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <string>
#include <vector>

#include "problems/opaque.hpp"
#include "problems/posts.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/learn/train.hpp"
#include "ricochet/planned.hpp"

namespace ricochet {
namespace {

using X = Posts::State;
using Stepping = FixedStep<Rk4>;
using learn::Random;

constexpr double h = Posts::step;
/// Events are located to a hundredth of a step, and sought at the ends of steps alone.
const Options how{.t_end = 100, .step = h, .event_tolerance = 1e-2 * h, .check_inside = false};
const learn::GateAim aim{
    .recipe = gate_recipe("state"), .step = h, .run_length = 100, .guard_seconds = 1e-4};

double seconds()
{
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// First events of flights, with what they cost.
struct Flights {
    std::vector<double> events;  ///< [s]; NaN: none
    std::uint64_t calls = 0, steps = 0;
    double time = 0;  ///< [s]
};

template <class System, class Detector>
Flights fly(const System& system, const std::vector<X>& starts, const Detector& detector)
{
    Flights out;
    Options options = how;
    options.stop_at_event = true;
    const double before = seconds();
    for (const X& x0 : starts) {
        const auto run = integrate(system, x0, options, Stepping{}, detector);
        out.events.push_back(run.events.empty() ? std::nan("") : run.events.front().t);
        out.calls += run.statistics.guard_calls;
        out.steps += run.statistics.steps;
    }
    out.time = seconds() - before;
    return out;
}

void print(std::string_view name, std::string_view knows, const Flights& flights,
           const Flights& exact)
{
    std::size_t events = 0;
    std::size_t lost = 0;
    for (std::size_t i = 0; i < exact.events.size(); ++i) {
        if (std::isnan(exact.events[i])) continue;
        ++events;
        lost += std::fabs(flights.events[i] - exact.events[i]) <= h ? 0 : 1;
    }
    const auto steps = static_cast<double>(flights.steps);
    const double per_step = flights.time / steps;
    const double calls = static_cast<double>(flights.calls);
    fmt::print("{:<22}{:<22}{:>10.1f}{:>10} of {}{:>12.3f}{:>12.2f}\n", name, knows,
               calls / static_cast<double>(events), lost, events, 1e6 * per_step,
               1e6 * per_step + 100 * calls / steps);
}

void table(const std::string& file, std::size_t runs)
{
    const Posts bounded;
    const Hidden<Posts> value(bounded);
    const SignOfPosts sign;
    const Calibrated<> gate(gates::Gate(load_model(file)));
    const Calibrated<Ends> gate_of_ends(gates::Gate(load_model(file)));
    Random random(2026);
    std::vector<X> starts;
    for (std::size_t i = 0; i < runs; ++i) starts.push_back(random_start(bounded, random));
    const Flights exact = fly(sign, starts, Ends{});
    fmt::print("{:<22}{:<22}{:>10}{:>10}{:>24}{:>12}\n", "way", "knows", "calls/ev.", "lost",
               "us a step", "+ 100 us");
    print("the end of every step", "sign", exact, exact);
    for (const std::size_t k : {2U, 3U, 8U}) {
        print(fmt::format("every {} steps", k), "sign", fly(sign, starts, EveryK<Ends>(k)), exact);
    }
    print("the gate", "sign", fly(sign, starts, gate), exact);
    print("SlopeSkip", "value", fly(value, starts, SlopeSkip<Ends>{}), exact);
    print("the gate", "value", fly(value, starts, gate_of_ends), exact);
    print("Planned", "value, rate, bounds", fly(bounded, starts, Planned<Ends>{}), exact);
}

learn::Starts<X> anywhere()
{
    return [posts = Posts()](Random& random) {
        return learn::RunStart<X>{.x = random_start(posts, random)};
    };
}

bool tell(const learn::Progress& progress)
{
    static std::string stage;
    static double last = 0;
    if (stage == progress.stage && seconds() < last + 10) return true;
    stage = progress.stage;
    last = seconds();
    fmt::print(stderr, "{} {}/{}\n", stage, progress.iteration, progress.total);
    return true;
}

void train(const std::string& file)
{
    const learn::TrainedGate trained =
        learn::train_gate(SignOfPosts(), anywhere(), Stepping{}, how, aim, tell);
    fmt::print("{}\n{}\n", learn::to_json(trained.report), trained.report.describe());
    save_model(trained.model, file);
}

int run(int argc, char** argv)
{
    CLI::App app("Ways to check a guard with thin targets", "ricochet_posts");
    std::string model = RICOCHET_MODELS "/posts-gate.safetensors";
    std::string out;
    std::size_t runs = 25'000;
    app.add_option("--model", model, "the gate of the table");
    app.add_option("--runs", runs, "flights of the table");
    app.add_option("--train", out, "train the gate, and write it to this file");
    CLI11_PARSE(app, argc, argv);
    if (!out.empty()) {
        train(out);
    } else {
        table(model, runs);
    }
    return 0;
}

}  // namespace
}  // namespace ricochet

int main(int argc, char** argv)
{
    try {
        return ricochet::run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "ricochet_posts: {}\n", error.what());
        return 2;
    }
}
