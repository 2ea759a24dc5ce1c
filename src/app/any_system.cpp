#include "any_system.hpp"

#include <stdexcept>
#include <utility>

#include "ricochet/detect/bernstein.hpp"
#include "ricochet/detect/ends.hpp"
#include "ricochet/detect/extremum.hpp"
#include "systems/run_system.hpp"

namespace ricochet::app {

TimedRun run_any(AnySystem any, const std::vector<double>& x0, const RunSettings& settings,
                 int repeats)
{
    const BoundedSystem system(std::move(any));
    if (settings.gate) return run_gated(system, x0, settings, repeats);
    TimedRun timed = with_stepping(settings, [&](auto stepping) {
        switch (settings.detector) {
            case DetectorKind::ends:
                return run_with(system, x0, settings, repeats, stepping, Ends{});
            case DetectorKind::extremum:
                return run_with(system, x0, settings, repeats, stepping, Extremum{});
            case DetectorKind::bernstein:
                return run_with(system, x0, settings, repeats, stepping, Bernstein{});
            default: throw std::logic_error("the system has no network and no line");
        }
    });
    if (system.guard_count() == 0) timed.run.statistics.evidence = {};  // of nothing
    return timed;
}

}  // namespace ricochet::app
