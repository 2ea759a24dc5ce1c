// Cavern over tens of thousands of events, and the evaluations needed to locate one.
#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "problems/cave_body.hpp"
#include "problems/cavern.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/planar_arm.hpp"
#include "ricochet/locate/locators.hpp"
#include "scene_rows.hpp"

namespace ricochet::bench {

namespace {

using Fixed = FixedStep<Rk4>;
using Controlled = ErrorControlled<Dopri5>;

Cavern::Parameters cavern(bool skims)
{
    return skims ? Cavern::skimming() : Cavern::Parameters{};
}

constexpr Options every_ms(double t_end)
{
    return {.t_end = t_end, .step = 1e-3};
}
constexpr Options dense(double t_end)
{
    return {.t_end = t_end, .rtol = 1e-9, .atol = 1e-9};
}

// --- the same events, many of them ---

struct Compared {
    std::uint64_t events = 0;
    bool same = true;
    std::vector<std::string> details{};
};

template <class Stepping>
void compare(Compared& all, std::string_view method, bool skims, const Options& options)
{
    const Cavern system(cavern(skims));
    const auto exact = integrate(system, system.start(), options, Stepping{}, Extremum{});
    const auto planned = integrate(system, system.start(), options, Stepping{}, planner());
    const bool same = hash_of(exact) == hash_of(planned);
    all.events += exact.statistics.events;
    all.same = all.same && same && exact.outcome == Outcome::reached_end;
    all.details.push_back(fmt::format("{}, {}: {} events in {} steps, {} exact calls and {}; {}",
                                      method, skims ? "skimming" : "flying",
                                      exact.statistics.events, exact.statistics.steps,
                                      exact.statistics.guard_calls, planned.statistics.guard_calls,
                                      same ? "the same bits" : "OTHER EVENTS"));
}

// --- location ---

/// Calls of any `Counted` guard.
std::uint64_t counted_calls = 0;

/// A system whose guard counts its calls.
template <class System>
struct Counted : System {
    using System::System;

    template <class... At>
    requires requires(const System& system, const At&... at) { system.guard(at...); }
    [[nodiscard]] double guard(const At&... at) const
    {
        ++counted_calls;
        return System::guard(at...);
    }
};

struct LocatorCalls {
    std::uint64_t locations = 0;
    std::uint64_t calls = 0;
};
LocatorCalls located;

/// Newton's locator, with its calls recorded.
struct WatchedNewton {
    [[nodiscard]] Location locate(GuardPath& probe, const GuardSample& lo, const GuardSample& hi,
                                  double tolerance) const
    {
        const std::uint64_t before = counted_calls;
        const Location found = Newton{}.locate(probe, lo, hi, tolerance);
        located.calls += counted_calls - before;
        ++located.locations;
        return found;
    }
};

double per_event(const LocatorCalls& counted)
{
    return static_cast<double>(counted.calls) / static_cast<double>(counted.locations);
}

struct Averages {
    LocatorCalls fixed{}, controlled{};
    std::vector<std::string> details{};
};

template <class Stepping, class System>
void locate(Averages& all, LocatorCalls& sum, std::string_view name, const System& system,
            const Options& options)
{
    located = {};
    const auto run =
        integrate(system, system.start(), options, Stepping{}, planner(), WatchedNewton{});
    sum.calls += located.calls;
    sum.locations += located.locations;
    all.details.push_back(fmt::format("{:<36}{:>7} events, {:.2f} exact calls each", name,
                                      run.statistics.events, per_event(located)));
}

template <class System>
void locate_both(Averages& all, std::string_view name, const System& system, double t_end)
{
    locate<Fixed>(all, all.fixed, fmt::format("{}, rk4", name), system, every_ms(t_end));
    locate<Controlled>(all, all.controlled, fmt::format("{}, dopri5 1e-9", name), system,
                       dense(t_end));
}

}  // namespace

Measured compare_many_events()
{
    Compared all;
    compare<Fixed>(all, "rk4 1 ms", true, every_ms(5500));
    compare<Fixed>(all, "rk4 1 ms", false, every_ms(1000));
    compare<Controlled>(all, "dopri5 1e-9", true, dense(5000));
    compare<Controlled>(all, "dopri5 1e-9", false, dense(10'000));
    return {.pass = all.same && all.events >= 30'000,
            .text = fmt::format("{} events, {}", all.events,
                                all.same ? "all the same" : "not the same"),
            .details = std::move(all.details)};
}

Measured count_location()
{
    Averages all;
    locate_both(all, "cavern, flying", Counted<Cavern>(cavern(false)), 500);
    locate_both(all, "cavern, skimming", Counted<Cavern>(cavern(true)), 100);
    locate_both(all, "arm, 4 joints, 40 obstacles", Counted<PlanarArm<4>>(), 60);
    locate_both(all, "cave body", Counted<CaveBody>(), 40);
    locate_both(all, "eigenvalue, level 1.55",
                Counted<LeastEigenvalue>(LeastEigenvalue::Parameters{.level = 1.55}), 40);
    const double fixed = per_event(all.fixed);
    const double controlled = per_event(all.controlled);
    return {.pass = fixed <= 5 && controlled <= 5,
            .text = fmt::format("rk4 {:.2f}, dopri5 {:.2f}", fixed, controlled),
            .details = std::move(all.details)};
}

}  // namespace ricochet::bench
