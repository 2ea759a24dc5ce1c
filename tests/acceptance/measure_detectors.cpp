// Cost that each detector adds to a step, with the networks of both shapes and the
// closed-form rival beside them.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/detail/ballistic_line.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/gates.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/nn/model.hpp"
#include "score.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

constexpr double step = 0.01;  ///< [s] of the fixed-step model, and of all here

struct Row {
    std::string_view detector;
    std::string_view network;
    Work work;
    bool right = false;  ///< the flight takes its steps, and B1 has its impacts
    double error = 0;    ///< [s] on B1
    std::uint64_t guard_calls = 0;
};

/// One flight of 305 steps, launched at 15 m/s: inside the box of the fixed-step
/// model, and ended before it meets the floor.
constexpr std::uint64_t steps = 305;

template <class System, class Detector>
Row flight(std::string_view name, std::string_view network, const System& system,
           const Detector& detector)
{
    const auto run = [=] {
        return integrate(system, std::array<double, 2>{0, 15},
                         {.t_end = 3.05, .step = step, .record_events = false}, FixedStep<Rk4>{},
                         detector);
    };
    const auto once = run();
    return {.detector = name,
            .network = network,
            .work = repeated(run),
            .right = once.statistics.steps == steps && once.statistics.events == 0,
            .guard_calls = once.statistics.guard_calls};
}

template <class Detector>
Row row(std::string_view name, std::string_view network, const Detector& detector)
{
    const BallProblem problem = b1();
    Row row = flight(name, network, problem.system, detector);
    const auto run = integrate(problem.system, problem.x0, {.t_end = problem.t_end, .step = step},
                               FixedStep<Rk4>{}, detector);
    std::vector<double> times;
    for (const auto& event : run.events) times.push_back(event.t);
    const Score found = score(times, problem.events);
    row.right = row.right && found.complete();
    row.error = found.error;
    return row;
}

Network stored(std::string_view name)
{
    return Network(
        load_model(std::filesystem::path(RICOCHET_MODELS) / fmt::format("{}.safetensors", name)));
}

}  // namespace

Measured compare_detectors()
{
    const Network any_step = stored("bouncing-ball");
    const Network fixed_step = stored("bouncing-ball-step-0.01");
    const std::vector<Row> rows{
        flight("none", "", Unguarded<BouncingBall>{BouncingBall()}, Ends{}),
        row("ends", "", Ends{}),
        row("extremum", "", Extremum{}),
        row("line", "", BallisticLine{}),
        row("network", "1x16", any_step),
        row("network", "5x16", fixed_step),
        row("verified", "1x16", Verified<Extremum>(any_step)),
        row("verified", "5x16", Verified<Extremum>(fixed_step)),
    };
    std::vector<Work> works{yardstick()};
    for (const Row& r : rows) works.push_back(r.work);
    const std::vector<Timing> timings = time_in_turns(works, {.budget = 0.1, .most = 501});
    const Timing& yard = timings[0];

    const auto cost = [&](std::size_t i) {
        return scaled(timings[i + 1].median, yard) / static_cast<double>(steps) * 1e9;
    };
    std::vector<std::string> details{fmt::format(
        "{:<10}{:<8}{:>9}{:>18}{:>9}{:>12}{:>13}{:>14}   rk4, step {} s", "detector", "hidden",
        "ns raw", "spread", "scaled", "over none", "guard/step", "error on b1", step)};
    bool right = true;
    std::string text;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const Row& r = rows[i];
        const Timing& time = timings[i + 1];
        const auto raw = [](double seconds) { return seconds / static_cast<double>(steps) * 1e9; };
        right = right && r.right && r.error <= 2e-14;
        details.push_back(fmt::format(
            "{:<10}{:<8}{:>9.2f}{:>18}{:>9.2f}{:>+12.2f}{:>13.3f}{:>14}{}", r.detector, r.network,
            raw(time.median), fmt::format("[{:.2f} - {:.2f}]", raw(time.p10), raw(time.p90)),
            cost(i), cost(i) - cost(0),
            static_cast<double>(r.guard_calls) / static_cast<double>(steps),
            i == 0 ? "-" : fmt::format("{:.1e} s", r.error), r.right ? "" : "  WRONG"));
        text += fmt::format("{}{}{}{} {:.1f}", i == 0 ? "" : ", ", r.detector,
                            r.network.empty() ? "" : " ", r.network, cost(i));
    }
    const double line = cost(3) - cost(0);
    const double cheapest = std::min(cost(4), cost(5)) - cost(0);
    details.push_back(fmt::format(
        "Asking costs {:.1f} ns a step (1x16) and {:.1f} ns (5x16), the line {:.1f} ns: here the "
        "network {}.",
        cost(4) - cost(0), cost(5) - cost(0), line,
        cheapest > line ? "learns at a price what one line says" : "is no dearer than the line"));
    return {.pass = right, .text = text + " ns a step (scaled)", .details = std::move(details)};
}

}  // namespace ricochet::bench
