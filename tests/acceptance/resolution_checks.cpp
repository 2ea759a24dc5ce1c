// Acceptance checks that no event is lost where guards accumulate, decay, or outpace the state.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "accumulating_systems.hpp"
#include "measure.hpp"
#include "random_guards.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::bench {

namespace {

using test::Draining;
using test::fault_of;
using test::Misses;
using test::misses_of;
using test::Spiral;

Measured accumulate()
{
    constexpr std::uint32_t runs = 100'000;
    std::map<std::string, int> faults;
    std::map<std::string, std::uint32_t> first;
    for (std::uint32_t seed = 1; seed <= runs; ++seed) {
        const std::string fault = fault_of(seed);
        if (fault.empty()) continue;
        if (faults[fault]++ == 0) first[fault] = seed;
    }
    Measured measured{.pass = faults.empty(), .text = {}};
    int wrong = 0;
    for (const auto& [fault, count] : faults) {
        wrong += count;
        measured.details.push_back(
            fmt::format("{}: {}, first with seed {}", fault, count, first[fault]));
    }
    measured.text = fmt::format("{} of {} wrong", wrong, runs);
    return measured;
}

Measured resolve_guards()
{
    constexpr std::uint32_t guards = 100'000;
    Misses all;
    std::size_t wide = 0;
    for (std::uint32_t seed = 1; seed <= guards; ++seed) {
        const Misses misses = misses_of(seed);
        all.roots += misses.roots;
        all.missed += misses.missed;
        all.widest = std::max(all.widest, misses.widest);
        wide += misses.widest > 0.125;
    }
    return {.pass = wide == 0,
            .text = fmt::format("{} of {} roots missed, the widest dip {:.3f} of its step",
                                all.missed, all.roots, all.widest)};
}

Measured follow_decaying_guards()
{
    double lost = 0;
    double all = 0;
    for (const Spiral::Kind kind : {Spiral::product, Spiral::component, Spiral::cube}) {
        for (const double decay : {0.1, 0.5, 2.0}) {
            const double power = kind == Spiral::product ? 2 : kind == Spiral::component ? 1 : 3;
            const double end = 660 / (decay * power);  // the guard has fallen to 1e-287
            const Spiral spiral{.kind = kind, .decay = decay};
            const auto run =
                integrate(spiral, Spiral::start, {.t_end = end, .rtol = 1e-8, .atol = 0});
            all += spiral.crossings(end);
            lost += std::fabs(spiral.crossings(end) - run.x[2]);
            lost += std::fabs(static_cast<double>(run.events.size()) - run.x[2]);
        }
    }
    return {.pass = lost == 0, .text = fmt::format("{} of {} crossings lost or more", lost, all)};
}

Measured drain()
{
    double worst = 0;
    for (const Draining::Kind kind : {Draining::root, Draining::torricelli, Draining::logarithm}) {
        const Draining tank{.kind = kind};
        const auto run =
            integrate(tank, Draining::State{1},
                      {.t_end = 5, .rtol = 1e-13, .atol = 1e-26, .stop_at_event = true});
        const bool there = run.outcome == Outcome::stopped_by_event;
        const double off =
            there ? std::fabs(run.t / tank.empty() - 1) : std::numeric_limits<double>::infinity();
        worst = std::max(worst, off);
    }
    return {.pass = worst <= 1e-12, .text = fmt::format("{:.1e} relative", worst)};
}

/// The same impacts for any end of the run and any limit of the steps.
Measured end_anywhere()
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    std::vector<double> wanted;
    std::size_t compared = 0;
    std::size_t wrong = 0;
    for (const double end : {8.5, 9.0, 20.0, 30.0, 1e3, 1e6, 1e100, 1e300}) {
        for (const double longest : {2.0, 10.0, 1e5, std::numeric_limits<double>::infinity()}) {
            const auto run = integrate(ball, {1, 0}, {.t_end = end, .h_max = longest});
            if (wanted.empty()) {
                for (const auto& event : run.events) wanted.push_back(event.t);
            }
            for (std::size_t i = 0; i < wanted.size(); ++i) {
                ++compared;
                wrong += !(i < run.events.size() && run.events[i].t == wanted[i]);
            }
        }
    }
    return {.pass = wrong == 0, .text = fmt::format("{} of {} impacts differ", wrong, compared)};
}

}  // namespace

std::vector<Check> resolution_checks()
{
    return {
        {.topic = "events",
         .id = "accumulation",
         .sentence = "Random balls on fixed, moving and vibrating floors fall through none and "
                     "do not flutter",
         .target = "0 of 100 000",
         .run = accumulate},
        {.topic = "events",
         .id = "moving-guards",
         .sentence = "Guards that move faster than the state are resolved",
         .target = "no dip missed wider than an eighth of its step",
         .run = resolve_guards},
        {.topic = "events",
         .id = "decaying-guards",
         .sentence = "Guards that decay to 1e-287 keep their crossings, and have no touches",
         .target = "0 lost",
         .run = follow_decaying_guards},
        {.topic = "events",
         .id = "domain-ends",
         .sentence = "A flow that ends at its surface has its event there",
         .target = "<= 1e-12 relative",
         .run = drain},
        {.topic = "events",
         .id = "far-ends",
         .sentence = "The ball's impacts are the same bits wherever its run ends",
         .target = "0 differ",
         .run = end_anywhere},
    };
}

}  // namespace ricochet::bench
