// Cost of watching guards: many crossings that are only recorded, and guards that
// never fire, each compared with the same system without guards.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "events_problems.hpp"
#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

/// Runs without guards, with the ends examined, and with the extremum searched for.
struct Trio {
    Timing none, ends, extremum;

    [[nodiscard]] double ends_ratio() const { return ends.median / none.median; }
    [[nodiscard]] double extremum_ratio() const { return extremum.median / none.median; }
};

struct Runs {
    Work none, ends, extremum;
    std::uint64_t steps = 0;
    bool same_steps = false;
};

template <class System, class X>
Runs runs_of(const System& system, const X& x0, const Options& options)
{
    const Unguarded<System> unguarded(system);
    const auto with = [=](const auto& of, const auto& detector) {
        return [=] { return integrate(of, x0, options, ErrorControlled<Dopri5>{}, detector); };
    };
    const auto none = with(unguarded, Ends{});
    const auto ends = with(system, Ends{});
    const auto extremum = with(system, Extremum{});
    const std::uint64_t steps = none().statistics.steps;
    return {.none = repeated(none),
            .ends = repeated(ends),
            .extremum = repeated(extremum),
            .steps = steps,
            .same_steps = ends().statistics.steps == steps && extremum().statistics.steps == steps};
}

Trio timed(const Runs& runs, double budget)
{
    const std::vector<Work> works{runs.none, runs.ends, runs.extremum};
    const auto timings = time_in_turns(works, {.budget = budget, .fewest = 21, .most = 501});
    return {.none = timings[0], .ends = timings[1], .extremum = timings[2]};
}

// --- recorded crossings ---

constexpr double tolerance = 1e-8;

struct Crossings {
    std::size_t expected = 0;
    std::size_t wrong = 0;  ///< oscillators with another number of them
    double error = 0;       ///< [s] largest
};

/// The crossings of every oscillator against its closed form.
template <class X>
Crossings score(const Run<X>& run, const Oscillators& oscillators, double t_end)
{
    Crossings score;
    std::vector<std::size_t> seen(oscillators.guard_count(), 0);
    for (const auto& event : run.events) {
        const double exact = oscillators.passage(event.guard, seen[event.guard]++);
        score.error = std::max(score.error, std::fabs(event.t - exact));
    }
    for (std::size_t i = 0; i < seen.size(); ++i) {
        std::size_t n = 0;
        while (oscillators.passage(i, n) <= t_end) ++n;
        score.expected += n;
        score.wrong += seen[i] != n;
    }
    return score;
}

struct Row {
    std::string name;
    Trio time;
    std::uint64_t steps = 0;
    Crossings ends, extremum;
    bool right = false;
    double limit = 0;
    std::string_view peers;
};

/// `states`: keep the states at the crossings, as by default.
template <class System, class X>
Row recorded(std::string name, const System& system, const X& x0, std::size_t n, double t_end,
             bool states, double limit, std::string_view peers)
{
    const Options options{
        .t_end = t_end, .rtol = tolerance, .atol = tolerance, .event_states = states};
    const Oscillators oscillators(n);
    const auto found = [&](const auto& detector) {
        return score(integrate(system, x0, options, ErrorControlled<Dopri5>{}, detector),
                     oscillators, t_end);
    };
    const Runs runs = runs_of(system, x0, options);
    Row row{.name = std::move(name),
            .time = timed(runs, 0.5),
            .steps = runs.steps,
            .ends = found(Ends{}),
            .extremum = found(Extremum{}),
            .limit = limit,
            .peers = peers};
    // A step adds an error of up to 1e-8, met at rates of order one: most steps add a tenth.
    const double bound = tolerance * static_cast<double>(runs.steps);
    row.right = runs.same_steps && row.ends.wrong == 0 && row.extremum.wrong == 0 &&
                row.ends.error <= bound && row.extremum.error <= bound;
    return row;
}

}  // namespace

Measured time_recorded_crossings()
{
    const auto many = [](std::size_t n, double t_end, std::string_view peers) {
        const Oscillators oscillators(n);
        return recorded(fmt::format("{} vector", n), oscillators, oscillators.start(), n, t_end,
                        n < 10, n < 10 ? 1.3 : 2, peers);
    };
    const std::vector<Row> rows{
        recorded("1 array", Oscillator{}, Oscillator::start(), 1, 100, true, 1.3, ""),
        many(1, 100, "2.3, 1.2, 1.1"),
        many(10, 100, "7.8, 3.1, 1.9"),
        many(100, 100, "39, 15, 8.7"),
        many(1000, 20, "343, 120, 62"),
    };
    std::vector<std::string> details{
        "N oscillators, w in [1, 2], upward passages through zero recorded; dopri5, rtol 1e-8; "
        "time over that of the same system without guards",
        fmt::format("{:<13}{:>7}{:>9}{:>15}{:>9}{:>10}{:>13}   {}", "N", "steps", "events",
                    "us without", "ends", "extremum", "error [s]",
                    "odeint, ARKODE, CVODE (recorded elsewhere)")};
    bool pass = true;
    std::string text;
    for (const Row& row : rows) {
        const double ends = row.time.ends_ratio();
        const double extremum = row.time.extremum_ratio();
        pass = pass && row.right && ends <= row.limit && extremum <= row.limit;
        text +=
            fmt::format("{}{} {:.2f} / {:.2f}", text.empty() ? "" : ", ", row.name, ends, extremum);
        details.push_back(fmt::format(
            "{:<13}{:>7}{:>9}{:>15.1f}{:>9.3f}{:>10.3f}{:>13.1e}   {}{}", row.name, row.steps,
            row.ends.expected, row.time.none.median * 1e6, ends, extremum,
            std::max(row.ends.error, row.extremum.error), row.peers, row.right ? "" : "  WRONG"));
    }
    details.push_back(
        "From N = 10 on the states at the crossings are not kept (event_states off): they would be "
        "2 N numbers each.");
    return {.pass = pass, .text = text + " (ends / extremum)", .details = std::move(details)};
}

// --- guards that never fire ---

namespace {

const Options swing{.t_end = 20, .rtol = 1e-8, .atol = 1e-8, .record_events = false};

std::string line(std::string_view name, const Runs& runs, const Trio& time)
{
    const auto ns = [&](const Timing& timing) {
        return timing.median / static_cast<double>(runs.steps) * 1e9;
    };
    return fmt::format(
        "{:<12}{:>6} steps, ns a step: {:.1f} without [{:.1f} - {:.1f}], ends {:.1f}, extremum "
        "{:.1f}",
        name, runs.steps, ns(time.none), time.none.p10 / static_cast<double>(runs.steps) * 1e9,
        time.none.p90 / static_cast<double>(runs.steps) * 1e9, ns(time.ends), ns(time.extremum));
}

}  // namespace

Measured time_idle_guard()
{
    const std::array<double, 2> x0{1, 0};
    const Runs runs = runs_of(WatchedPendulum{}, x0, swing);
    const Trio time = timed(runs, 0.5);
    const double ends = 100 * (time.ends_ratio() - 1);
    const double extremum = 100 * (time.extremum_ratio() - 1);
    return {.pass = runs.same_steps && ends <= 5 && extremum <= 15,
            .text = fmt::format("ends {:+.1f} %, extremum {:+.1f} %", ends, extremum),
            .details = {line("1 guard", runs, time)}};
}

Measured time_hundred_idle_guards()
{
    const std::array<double, 2> x0{1, 0};
    const Runs runs = runs_of(PendulumOfManyGuards{}, x0, swing);
    const Trio time = timed(runs, 0.5);
    return {.pass = runs.same_steps && time.ends_ratio() <= 2,
            .text = fmt::format("ends {:.2f} times, extremum {:.2f} times the loop without guards",
                                time.ends_ratio(), time.extremum_ratio()),
            .details = {line("100 guards", runs, time)}};
}

}  // namespace ricochet::bench
