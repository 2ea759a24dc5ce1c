// Converts settings to a run: every method, detector and locator for one system. Included once per
// system.
#pragma once

#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "../input.hpp"
#include "../registry.hpp"
#include "app/ballistic_line.hpp"
#include "core/detect/named_detectors.hpp"
#include "has_series.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::app {

/// One of the locators, by name.
struct ChosenLocator {
    LocatorKind kind;

    [[nodiscard]] detail::Location locate(GuardPath& path, const GuardSample& lo,
                                          const GuardSample& hi, double tolerance) const
    {
        switch (kind) {
            case LocatorKind::newton: break;
            case LocatorKind::bisection: return Bisection{}.locate(path, lo, hi, tolerance);
            case LocatorKind::toms748: return Toms748{}.locate(path, lo, hi, tolerance);
        }
        return Newton{}.locate(path, lo, hi, tolerance);
    }
};

/// A detector in the form that the loop takes.
template <class X>
struct ChosenDetector {
    detail::DetectorTable<X> table;
    const void* detector;
};

template <class System, class X, class Detector>
[[nodiscard]] ChosenDetector<detail::CoreState<X>> chosen(const Detector& detector)
{
    return {detail::DetectorTableOf<Detector, System, X>::make(detector), &detector};
}

/// Calls `use` with the gate of the settings.
/// @throws BadInput for a gate that does not fit the system.
template <class System, class X, class Use>
TimedRun with_gate(const RunSettings& settings, Use&& use)
{
    const Model& model = settings.gate.value();
    const bool horizon = model.kind == "gate-horizon";
    const bool blind = settings.detector == DetectorKind::calibrated && horizon;
    if (!blind && !BoundedGuards<System, X>) {
        throw BadInput("the " + std::string(name(settings.detector)) +
                       " gate closes intervals by bounds, which this system does not declare; "
                       "expected --gate calibrated with a horizon gate");
    }
    try {
        if (settings.detector == DetectorKind::certified) {
            return use(chosen<System, X>(Certified<>(model)));
        }
        if (settings.detector == DetectorKind::verified) {
            return use(chosen<System, X>(Foreseen<>(gates::Gate(model))));
        }
        if (horizon) return use(chosen<System, X>(Calibrated<>(gates::Gate(model))));
        return use(chosen<System, X>(CalibratedBounds<>(gates::Gate(model))));
    } catch (const std::invalid_argument& error) {
        throw BadInput("model '" + settings.model.string() + "': " + error.what());
    }
}

/// Calls `use` with the detector of the settings.
/// @throws std::logic_error for a detector that the system's entry does not offer.
template <class System, class X, class Use>
TimedRun with_detector(const RunSettings& settings, Use&& use)
{
    if (settings.gate) return with_gate<System, X>(settings, use);
    if constexpr (fixed_guard_count<System, X>() == 1) {
        if (settings.detector == DetectorKind::network) {
            return use(chosen<System, X>(settings.network.value()));
        }
        if (settings.detector == DetectorKind::verified) {
            return use(chosen<System, X>(Verified<Extremum>(settings.network.value())));
        }
    }
    // Lines and networks apply to systems that provide their parameters.
    if constexpr (CurvedGuard<System, X> && requires(const System& s) { s.parameter(""); }) {
        if (settings.detector == DetectorKind::line) {
            return use(chosen<System, X>(BallisticLine{}));
        }
    }
    TimedRun run;
    const bool found = ricochet::detail::NamedDetectors::at(
        static_cast<std::size_t>(settings.detector),
        [&]<class Detector>() { run = use(chosen<System, X>(Detector{})); });
    if (!found) throw std::logic_error("the system has no such detector");
    return run;
}

/// The same run with one type of state for all systems; without its dense solution, which
/// is not needed here.
template <class X>
[[nodiscard]] Run<std::vector<double>> with_plain_states(Run<X> run)
{
    if constexpr (std::is_same_v<X, std::vector<double>>) return run;
    const auto plain = [](const X& x) { return std::vector<double>(x.begin(), x.end()); };
    Run<std::vector<double>> out{.outcome = run.outcome,
                                 .t = run.t,
                                 .x = plain(run.x),
                                 .mode = run.mode,
                                 .guard = run.guard,
                                 .other_guard = run.other_guard,
                                 .reason = run.reason,
                                 .armed_beyond = run.armed_beyond,
                                 .armed_on_surface = run.armed_on_surface,
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
                              .late = event.late,
                              .reaction = event.reaction});
    }
    for (const X& x : run.trajectory.x) out.trajectory.x.push_back(plain(x));
    return out;
}

/// Steps of methods that are compiled in the library.
struct NamedSteps {
    using Method = MethodByName;

    template <class Setup>
    static void take(Setup& /*setup*/)
    {
    }
};
template <class System, class X>
struct SeriesSteps {
    static constexpr std::size_t n = detail::fixed_size<typename System::State>();
    using Method = detail::TaylorOf<n>;

    static void take(detail::RunBindings<detail::CoreState<X>>& setup)
    {
        detail::step_by_series<System, X, n>(setup);
    }
};

/// `run_system` with steps by `method`.
template <class Steps, class System, class X>
[[nodiscard]] TimedRun run_by(const typename Steps::Method& method, const System& system,
                              const X& x0, const RunSettings& settings, int repeats)
{
    using Method = typename Steps::Method;
    using Core = detail::CoreState<X>;
    using Parts =
        detail::RunComponents<System, X, ErrorControlled<Method>, Extremum, ChosenLocator>;
    return with_detector<System, X>(settings, [&](const ChosenDetector<Core>& chosen) {
        Run<Core> run;
        const X from = chosen_start(x0, settings);
        const auto start = std::chrono::steady_clock::now();
        for (int i = 0; i < repeats; ++i) {
            Parts parts(system, from, {method}, {}, {settings.locator});
            detail::RunBindings<Core> setup = parts.setup();
            setup.error_controlled = !settings.fixed_step;
            setup.detector = chosen.table;
            setup.detecting = chosen.detector;
            Steps::take(setup);
            run = detail::run_whole(setup, detail::core_state(from), settings.options);
        }
        const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
        return TimedRun{.run = with_plain_states(std::move(run)),
                        .seconds = spent.count() / repeats};
    });
}

/// Runs `system` from x0 `repeats` times as `integrate` does, and returns the last run.
///
/// The loop takes its method, detector and locator as tables: one run is compiled for each system,
/// for all settings, and one more if its flow can be a power series.
template <class System, class X>
[[nodiscard]] TimedRun run_system(const System& system, const X& x0, const RunSettings& settings,
                                  int repeats)
{
    if constexpr (has_series<System>) {
        if (settings.stepper.is_taylor()) {
            return run_by<SeriesSteps<System, X>>({}, system, x0, settings, repeats);
        }
    }
    return run_by<NamedSteps>({settings.stepper.method()}, system, x0, settings, repeats);
}

}  // namespace ricochet::app
