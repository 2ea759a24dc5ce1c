// From settings to the templates: every detector for one system.
//
// Detectors are compiled, since detection is the inner loop; methods and locators are chosen at run
// time. Included once per system.
#pragma once

#include <chrono>
#include <stdexcept>
#include <utility>
#include <vector>

#include "../registry.hpp"
#include "ricochet/detail/ballistic_line.hpp"
#include "ricochet/detect/bernstein.hpp"
#include "ricochet/detect/ends.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/detect/verified.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/locate/bisection.hpp"
#include "ricochet/locate/newton.hpp"
#include "ricochet/locate/toms748.hpp"

namespace ricochet::app {

/// One of the locators, by name.
struct ChosenLocator {
    LocatorKind kind;

    [[nodiscard]] Location locate(GuardPath& path, const GuardSample& lo, const GuardSample& hi,
                                  double tolerance) const
    {
        switch (kind) {
            case LocatorKind::newton: break;
            case LocatorKind::bisection: return Bisection{}.locate(path, lo, hi, tolerance);
            case LocatorKind::toms748: return Toms748{}.locate(path, lo, hi, tolerance);
        }
        return Newton{}.locate(path, lo, hi, tolerance);
    }
};

/// Calls `use` with the stepping of the settings.
template <class Use>
TimedRun with_stepping(const RunSettings& settings, Use&& use)
{
    const MethodByName method{settings.stepper};
    return settings.fixed_step ? use(FixedStep<MethodByName>{method})
                               : use(ErrorControlled<MethodByName>{method});
}

/// Calls `use` with the detector of the settings.
/// @throws std::logic_error for `line` where the system has no closed curvature.
template <class System, class X, class Use>
TimedRun with_detector(const RunSettings& settings, Use&& use)
{
    switch (settings.detector) {
        case DetectorKind::ends: return use(Ends{});
        case DetectorKind::bernstein: return use(Bernstein{});
        case DetectorKind::network: return use(settings.network.value());
        case DetectorKind::verified: return use(Verified<Extremum>(settings.network.value()));
        case DetectorKind::line:
            if constexpr (CurvedGuard<System, X>) {
                return use(BallisticLine{});
            } else {
                throw std::logic_error("a system with a line has a guard curvature");
            }
        case DetectorKind::certified:
        case DetectorKind::calibrated: throw std::logic_error("gates are run by run_gated");
        case DetectorKind::extremum: break;
    }
    return use(Extremum{});
}

/// The same run with states of one type for all systems; without its solution, which
/// nobody asks for here.
template <class X>
[[nodiscard]] Run<std::vector<double>> with_plain_states(const Run<X>& run)
{
    const auto plain = [](const X& x) {
        std::vector<double> out;
        for (std::size_t i = 0; i < static_cast<std::size_t>(x.size()); ++i) out.push_back(x[i]);
        return out;
    };
    Run<std::vector<double>> out{.outcome = run.outcome,
                                 .t = run.t,
                                 .x = plain(run.x),
                                 .mode = run.mode,
                                 .guard = run.guard,
                                 .other_guard = run.other_guard,
                                 .events = {},
                                 .trajectory = {.t = run.trajectory.t, .x = {}},
                                 .solution = {},
                                 .wrong_bound = {},
                                 .statistics = run.statistics};
    for (const Event<X>& event : run.events) {
        out.events.push_back({.t = event.t,
                              .kind = event.kind,
                              .guard = event.guard,
                              .mode_before = event.mode_before,
                              .mode_after = event.mode_after,
                              .before = plain(event.before),
                              .after = plain(event.after),
                              .bracket = event.bracket,
                              .slope = event.slope,
                              .error = event.error,
                              .late = event.late});
    }
    for (const X& x : run.trajectory.x) out.trajectory.x.push_back(plain(x));
    return out;
}

/// Runs `system` from x0 `repeats` times with this stepping and detector, and returns
/// the last run.
template <class System, class X, class Stepping, class Detector>
[[nodiscard]] TimedRun run_with(const System& system, const X& x0, const RunSettings& settings,
                                int repeats, const Stepping& stepping, const Detector& detector)
{
    const ChosenLocator locator{settings.locator};
    Run<X> run;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < repeats; ++i) {
        run = integrate(system, x0, settings.options, stepping, detector, locator);
    }
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    return TimedRun{.run = with_plain_states(run), .seconds = spent.count() / repeats};
}

/// As `run_with`, with the stepping and the detector of the settings.
template <class System, class X>
[[nodiscard]] TimedRun run_system(const System& system, const X& x0, const RunSettings& settings,
                                  int repeats)
{
    return with_stepping(settings, [&](auto stepping) {
        return with_detector<System, X>(settings, [&](const auto& detector) {
            return run_with(system, x0, settings, repeats, stepping, detector);
        });
    });
}

}  // namespace ricochet::app
