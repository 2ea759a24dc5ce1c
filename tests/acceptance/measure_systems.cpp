// Checks every problem with a known solution: all events are found, no others, and in order.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clustered_systems.hpp"
#include "known_solutions.hpp"
#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "score.hpp"

namespace ricochet::bench {

namespace {

using test::Happening;
using test::How;
using test::KnownSolution;
using test::PlainRun;

constexpr double any = std::numeric_limits<double>::infinity();

/// The name of a problem in the literature or in the tables of this project.
std::string label(const std::string& name)
{
    static const std::map<std::string, std::string> labels{
        {"hidden_pair", "D1"},  {"near_tangent", "D2"},       {"pendulum", "P1"},
        {"henon_heiles", "P2"}, {"three_body", "P3"},         {"thermostat", "M1"},
        {"grow_decay", "M2"},   {"coulomb_oscillator", "C1"}, {"stick_slip", "C2"},
        {"detest_f1", "F1"},    {"detest_f2", "F2"},          {"detest_f3", "F3"},
        {"detest_f4", "F4"},    {"detest_f5", "F5"},          {"impact_oscillator", "O1"},
    };
    const auto found = labels.find(name);
    return found == labels.end() ? name : fmt::format("{} {}", found->second, name);
}

template <class P>
KnownSolution ball(const P& problem)
{
    return {.name = problem.name,
            .start = test::as_vector(problem.x0),
            .options = {.t_end = problem.t_end, .rtol = 1e-13, .atol = 1e-13},
            .events = test::crossings(problem.events),
            .run = test::runs(problem.system)};
}

/// O1 over a thousand periods. A time of up to 9000 is known up to its own rounding.
KnownSolution impact_oscillator(double frequency)
{
    const ImpactOscillator system({.frequency = frequency});
    const double t_end = 1000 * system.period();
    return {.name = fmt::format("O1 w = {}", frequency),
            .start = test::as_vector(ImpactOscillator::start),
            .options = {.t_end = t_end, .rtol = 1e-13, .atol = 1e-13},
            .events = test::crossings(system.impacts(t_end)),
            .run = test::runs(system)};
}

/// D3. A touch lies where the guard is within the band, which is about sqrt(2 band) s wide;
/// the band covers the error of the integration.
KnownSolution touch(double depth)
{
    constexpr double band = 1e-12;
    const NearTangent system({.depth = depth, .phase = 1, .touch = band});
    std::vector<Happening> events = test::crossings(system.events(20));
    for (Happening& event : events) event.kind = EventKind::touch;
    return {.name = fmt::format("D3 depth {}", depth),
            .start = test::as_vector(system.start()),
            .options = {.t_end = 20, .rtol = 1e-13, .atol = 1e-13},
            .events = std::move(events),
            .time_error = std::sqrt(2 * band),
            .hows = {How::dopri5_extremum, How::fehlberg78_extremum},
            .run = test::runs(system)};
}

KnownSolution clustered(bool backward)
{
    const double from = backward ? 1 : -1;
    std::vector<Happening> events;
    for (std::size_t k = 0; k < 4; ++k) {
        const std::size_t i = backward ? 3 - k : k;
        events.push_back({.t = test::Clustered::offsets[i], .guard = i});
    }
    return {.name = backward ? "S1 backward" : "S1 forward",
            .start = {from},
            .options = {.t_start = from, .t_end = -from, .step = 2},
            .events = std::move(events),
            .run = test::runs(test::Clustered())};
}

KnownSolution three_roots(bool squared, double shift, double slip)
{
    const test::ThreeRoots system{.squared = squared, .shift = shift, .slip = slip};
    std::vector<Happening> events;
    for (std::size_t i = 0; i < 3; ++i) events.push_back({.t = system.time(i)});
    return {.name = fmt::format("S2 s = {}{}{}", squared ? "t^2" : "t",
                                shift > 0 ? ", shifted" : "", slip > 0 ? ", slips" : ""),
            .start = {shift},
            .options = {.t_end = 1, .event_tolerance = slip > 0 ? 1e-12 : 0},
            .events = std::move(events),
            // A degree of six in one step is more than a cubic through its ends can represent.
            .hows = squared ? std::vector<How>{} : std::vector<How>{How::dopri5_extremum},
            .run = test::runs(system)};
}

/// In the order of the guards: both fire at every third event.
KnownSolution synchronous(bool swapped)
{
    const test::Synchronous system{.swapped = swapped, .acts = true};
    std::vector<Happening> events;
    for (int k = 1; k < 12; k += 2) {
        const double t = k * std::numbers::pi / 6;
        const std::size_t of_u = swapped ? 1 : 0;
        if (k % 6 != 3) {
            events.push_back({.t = t, .guard = of_u});
        } else {
            for (const std::size_t guard : {0U, 1U}) events.push_back({.t = t, .guard = guard});
        }
    }
    return {.name = swapped ? "S3 swapped" : "S3",
            .start = test::as_vector(test::Synchronous::start),
            .options = {.t_end = 6.28, .rtol = 1e-13, .atol = 1e-13, .event_window = 1e-11},
            .events = std::move(events),
            .end = {std::cos(3 * 6.28), std::cos(6.28), 6},
            .hows = {How::dopri5_extremum},  // quadratures: see Fehlberg78
            .run = test::runs(system)};
}

std::vector<KnownSolution> problems()
{
    std::vector<KnownSolution> all{ball(b1()), ball(b2()), ball(b3())};
    for (KnownSolution& known : test::known_solutions()) all.push_back(std::move(known));
    for (const double frequency : {0.7, 0.8, 1.0, 1.2}) all.push_back(impact_oscillator(frequency));
    for (const double depth : {0.0, -1e-6}) all.push_back(touch(depth));
    for (const bool backward : {false, true}) all.push_back(clustered(backward));
    for (const double shift : {0.0, 0.1}) {
        for (const double slip : {0.0, 1e-14}) all.push_back(three_roots(false, shift, slip));
    }
    for (const bool swapped : {false, true}) all.push_back(synchronous(swapped));
    return all;
}

struct Findings {
    std::size_t missed = 0;
    std::size_t spurious = 0;
    std::size_t wrong_order = 0;  ///< another guard or kind of event than expected
    double error = 0;             ///< of a time t, over max(1, |t|)
    double end_error = 0;         ///< of a component, over max(1, its size)
};

Findings findings(const PlainRun& run, const KnownSolution& known)
{
    Findings out;
    if (run.events.size() == known.events.size()) {
        for (std::size_t i = 0; i < known.events.size(); ++i) {
            const Happening& exact = known.events[i];
            const Happening& found = run.events[i];
            out.wrong_order += found.guard != exact.guard || found.kind != exact.kind;
            out.error = std::max(out.error,
                                 std::fabs(found.t - exact.t) / std::max(1.0, std::fabs(exact.t)));
        }
    } else {
        std::vector<double> times;
        std::vector<double> reference;
        for (const Happening& event : run.events) times.push_back(event.t);
        for (const Happening& event : known.events) reference.push_back(event.t);
        const Score found = score(times, reference);
        out.missed = found.missed;
        out.spurious = found.spurious;
        out.error = any;
    }
    for (std::size_t i = 0; i < known.end.size(); ++i) {
        const double size = std::max(1.0, std::fabs(known.end[i]));
        out.end_error = std::max(out.end_error, std::fabs(run.x[i] - known.end[i]) / size);
    }
    return out;
}

std::string_view name(How how)
{
    switch (how) {
        case How::dopri5_extremum: return "dopri5 extremum";
        case How::dopri5_ends: return "dopri5 ends";
        case How::fehlberg78_extremum: return "fehlberg78 extremum";
    }
    return "";
}

}  // namespace

Measured compare_systems()
{
    std::vector<std::string> details{fmt::format(
        "{:<22}{:<21}{:>7}{:>8}{:>10}{:>13}{:>12}{:>12}{:>12}", "problem", "method", "events",
        "missed", "spurious", "wrong order", "rel. error", "allowed", "end error")};
    std::size_t runs = 0;
    std::size_t right = 0;
    Findings total;
    for (const KnownSolution& known : problems()) {
        for (const How how : known.hows) {
            const PlainRun run = known.run(known.start, known.options, how);
            const Findings found = findings(run, known);
            const bool good = run.outcome == Outcome::reached_end && run.mode == known.mode &&
                              found.missed + found.spurious + found.wrong_order == 0 &&
                              found.error <= known.time_error && found.end_error <= known.end_error;
            ++runs;
            right += good;
            total.missed += found.missed;
            total.spurious += found.spurious;
            total.wrong_order += found.wrong_order;
            details.push_back(
                fmt::format("{:<22}{:<21}{:>7}{:>8}{:>10}{:>13}{:>12.1e}{:>12.1e}{:>12}{}",
                            label(known.name), name(how), known.events.size(), found.missed,
                            found.spurious, found.wrong_order, found.error, known.time_error,
                            known.end.empty() ? "-" : fmt::format("{:.1e}", found.end_error),
                            good ? "" : "  WRONG"));
        }
    }
    return {
        .pass = right == runs,
        .text = fmt::format("{} of {} runs right: {} missed, {} spurious, {} in the wrong order",
                            right, runs, total.missed, total.spurious, total.wrong_order),
        .details = std::move(details)};
}

}  // namespace ricochet::bench
