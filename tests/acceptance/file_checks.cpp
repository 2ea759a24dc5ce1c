// Saved runs, potential files and runs that cannot continue: no file is mistaken for a valid one.
#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "measure.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/faults/friction.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/run.hpp"
#include "ricochet/locate/locators.hpp"
#include "saved_systems.hpp"

namespace ricochet::bench {

namespace {

using test::Ball;
using test::changed;
using test::Droplet;
using test::Losing;
using test::Sawtooth;
using X = Ball::State;

const Options ball_options{.t_end = 4};

Snapshot saved_ball()
{
    return test::saved_ball(ball_options);
}

// --- snapshots ---

template <class System, class... Choices>
bool takes(const System& system, const Options& options, const Choices&... choices)
{
    return test::refused_by(saved_ball(), system, options, choices...) == "accepted";
}

Measured refuse_other_runs()
{
    using Controlled = ErrorControlled<Dopri5>;
    const std::vector<bool> taken{
        takes(Droplet{}, ball_options),
        takes(Ball{}, ball_options, ErrorControlled<Fehlberg78>{}),
        takes(Ball{}, {.t_end = 4, .step = 0.01}, FixedStep<Dopri5>{}),
        takes(Ball{}, ball_options, Controlled{}, Ends{}),
        takes(Ball{}, ball_options, Controlled{}, Extremum{}, Toms748{}),
        takes(Ball{}, {.t_start = 1e-9, .t_end = 4}),
        takes(Ball{}, {.t_end = -4}),
        takes(Ball{}, {.t_end = 1e-3}),
        takes(Ball{}, {.t_end = 4, .rtol = 1e-6}),
        takes(Ball{}, {.t_end = 4, .atol = 1e-6}),
        takes(Ball{}, {.t_end = 4, .h_max = 1}),
        takes(Ball{}, {.t_end = 4, .event_tolerance = 1e-6}),
        takes(Ball{}, {.t_end = 4, .event_window = 1e-6}),
        takes(Ball{}, {.t_end = 4, .stop_at_event = true}),
    };
    std::size_t wrong = 0;
    for (const bool one : taken) wrong += one;
    const bool same = takes(Ball{}, {.t_end = 9, .record_steps = true});
    return {.pass = wrong == 0 && same,
            .text = fmt::format("{} of {} other runs taken; the same with another end {}", wrong,
                                taken.size(), same ? "taken" : "refused")};
}

Measured refuse_changed_texts()
{
    const std::string text = to_text(saved_ball());
    std::mt19937_64 random(8);
    int tried = 0;
    int taken = 0;
    for (int i = 0; i < 100'000; ++i) {
        const std::string other = changed(text, random);
        if (other == text) continue;
        ++tried;
        taken += refusal([&] { (void)snapshot_from_text(other); }) == "accepted";
    }
    return {.pass = taken == 0, .text = fmt::format("{} of {} taken", taken, tried)};
}

/// Snapshots with one number or count replaced by a hostile one; accepted ones are run.
Measured run_hostile_snapshots()
{
    const Snapshot good = saved_ball();
    const Ball ball;
    Simulation<Ball, X> simulation(ball, X{1, 0}, ball_options);
    const double infinity = std::numeric_limits<double>::infinity();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::mt19937_64 random(9);
    int refused = 0;
    int beyond = 0;
    constexpr int trials = 9000;
    for (int i = 0; i < trials; ++i) {
        Snapshot bad = good;
        if (random() % 2 == 0) {
            const std::array<double, 8> hostile{nan,  infinity, -infinity, 1e308,
                                                -1.0, 5e-324,   0.0,       1e9};
            bad.numbers[random() % bad.numbers.size()] = hostile[random() % hostile.size()];
        } else {
            const std::array<std::uint64_t, 5> hostile{2, 3, 255, 1u << 31, ~std::uint64_t{0}};
            bad.counts[random() % bad.counts.size()] = hostile[random() % hostile.size()];
        }
        if (refusal([&] { simulation.restore(bad); }) != "accepted") {
            ++refused;
            continue;
        }
        Options options = ball_options;
        options.max_steps = 100'000;
        Simulation<Ball, X> other(ball, X{1, 0}, options);
        other.restore(bad);
        const auto run = other.take();
        beyond += !(run.t >= 0 && run.t <= options.t_end);
    }
    return {.pass = beyond == 0,
            .text = fmt::format("{} refused, {} run to an outcome, {} of them beyond the end",
                                refused, trials - refused, beyond)};
}

// --- states that lose a component ---

Measured lose_components()
{
    int runs = 0;
    int named = 0;
    for (const auto where : {Losing::in_late_flow, Losing::in_reset, Losing::in_rest,
                             Losing::in_time_reset, Losing::to_nothing}) {
        for (const bool fixed : {false, true}) {
            const Options options{.t_end = 5, .step = 0.01};
            const auto run =
                fixed ? integrate(Losing{where}, Losing::State{1, 0}, options, FixedStep<Rk4>{})
                      : integrate(Losing{where}, Losing::State{1, 0}, options);
            ++runs;
            named += run.outcome == Outcome::wrong_dimension && run.x.size() == 2;
        }
    }
    return {.pass = named == runs, .text = fmt::format("{} of {} runs end so", named, runs)};
}

// --- time that stands still ---

Measured stand_still()
{
    const auto run = integrate(Sawtooth{}, {0}, {.t_end = 1, .record_events = false});
    return {.pass = run.outcome == Outcome::stalled && run.statistics.steps <= 2'000'000,
            .text = fmt::format("{} after {} steps at t = {:.1e} s of 1 s", name(run.outcome),
                                run.statistics.steps, run.t)};
}

// --- potential files ---

Measured refuse_potential_files()
{
    MonotoneNet rising;
    rising.slope = 1;
    const std::string good = to_json(AdditivePair(
        {.direct = rising, .state = rising, .rate = rising, .domain = {1e-9, 1e-3, -5, 25}}));
    const auto refused = [](const std::string& text) {
        try {
            (void)parse_pair(text, "file");
        } catch (const PotentialFileError&) {
            return true;
        }
        return false;
    };
    const auto replaced = [&](const std::string& from, const std::string& to) {
        std::string text = good;
        const std::size_t at = text.find(from);
        if (at == std::string::npos) throw std::runtime_error("no " + from + " in " + good);
        return text.replace(at, from.size(), to);
    };
    const std::vector<std::string> bad{
        replaced("\"v_min\": 1e-09", "\"v_min\": 1"),
        replaced("\"v_min\": 1e-09", "\"v_min\": -1e-9"),
        replaced("\"v_max\": 0.001", "\"v_max\": 1e300"),
        replaced("\"xi_min\": -5.0", "\"xi_min\": 30"),
        replaced("\"xi_max\": 25.0", "\"xi_max\": 1e6"),
        replaced("\"xi_max\": 25.0", "\"xi_max\": \"25\""),
        replaced("\"version\": 1", "\"version\": \"1\""),
        replaced("\"convex\": true", "\"convex\": 1"),
        "{\"format\": " + std::string(100'000, '[') + std::string(100'000, ']') + "}",
    };
    std::size_t taken = !refused(good) ? 0 : 1;
    for (const std::string& text : bad) taken += !refused(text);

    // The other files are refused by the exception of a potential file, or are read.
    std::mt19937_64 random(10);
    constexpr int trials = 100'000;
    for (int i = 0; i < trials; ++i) {
        std::string changed = good;
        for (std::uint64_t k = 0; k <= random() % 4; ++k) {
            changed[random() % changed.size()] = "{}[]\":,0123456789.eE-+ntf \n"[random() % 27];
        }
        (void)refused(changed);
    }
    return {.pass = taken == 0,
            .text = fmt::format("{} of {} wrong files taken; {} changed texts: no other exception",
                                taken, bad.size(), trials)};
}

}  // namespace

std::vector<Check> file_checks()
{
    return {
        {.topic = "files",
         .id = "other-runs",
         .sentence = "snapshots of a run are refused by any other: system, method, detector, "
                     "locator, times, tolerances",
         .target = "0 taken",
         .run = refuse_other_runs},
        {.topic = "files",
         .id = "changed-snapshots",
         .sentence = "texts of snapshots, changed or cut",
         .target = "0 of 100 000 taken",
         .run = refuse_changed_texts},
        {.topic = "files",
         .id = "hostile-snapshots",
         .sentence = "snapshots with a hostile number: refused, or run to an outcome",
         .target = "none beyond its end, no hang",
         .run = run_hostile_snapshots},
        {.topic = "files",
         .id = "lost-components",
         .sentence = "flow, reset, rest or time_reset loses a component of the state",
         .target = "wrong_dimension before it is read, 10 of 10",
         .run = lose_components},
        {.topic = "files",
         .id = "stalled",
         .sentence = "a run whose time stands still ends by default",
         .target = "stalled within 2e6 steps",
         .run = stand_still},
        {.topic = "files",
         .id = "potential-files",
         .sentence = "potential files with wrong domains, types or depth, and 100 000 changed ones",
         .target = "0 wrong ones taken, no other exception",
         .run = refuse_potential_files},
    };
}

}  // namespace ricochet::bench
