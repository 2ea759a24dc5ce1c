// Internal: the declarations of this header may change without notice.
//
// A detector and a locator as tables of functions, for the loop.
#pragma once

#include <cstddef>
#include <cstdint>

#include "ricochet/detail/motion_tube.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/finding.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/step_probe.hpp"

namespace ricochet {

struct MeterOptions;

}  // namespace ricochet

namespace ricochet::detail {

/// As `Extremum::suspects`.
using Suspects = bool(double sign, const GuardSample& start, const GuardSample& end);

/// Answer of a gate about a state, see `gates::Gate::Answer`.
struct GateAnswer {
    double cleared = 0;
    bool outside = false;
};

template <class X>
struct DetectorTable {
    using Self = const void*;

    const char* type = "";  ///< as the compiler writes it
    Screening screening = Screening::ends;
    bool uses_rates = false;
    bool checks_inside = false;
    Evidence evidence = Evidence::assumed;  ///< of a step not suspected
    Suspects* suspects = nullptr;
    bool (*leaves_plainly)(double sign, const GuardSample& start, const GuardSample& end,
                           double touch) = nullptr;
    Finding (*examine)(Self, GuardPath& path, Watch& watch) = nullptr;
    /// Checks whether the detector fits the system, in steps between `smallest` and `largest` [s].
    /// @throws std::invalid_argument if it does not
    void (*check)(Self, void* adapter, const X& x, double smallest, double largest) = nullptr;

    // --- predictions of one guard ---
    bool (*clears)(Self, void* adapter, const StepState<X>& step, std::uint64_t& calls) = nullptr;
    bool checks_every_step = true;

    // --- deferred checks ---
    bool defers = false;
    bool needs_bounds = false;
    Evidence deferred = Evidence::assumed;  ///< of a step without a check
    std::size_t longest = 1;
    bool checks_bounds = false;
    double margin = 0;
    double (*sure)(Self, const GuardBound& at, double band) = nullptr;
    double (*hoped)(Self, const GuardBound& at, double slope, double band) = nullptr;
    bool (*closes)(Self, const GuardBound& from, const GuardBound& to, double tau,
                   double band) = nullptr;
    GateAnswer (*horizon)(Self, void* adapter, Mode mode, double t, const X& x) = nullptr;
    GateAnswer (*level)(Self, void* adapter, GuardInMode, double t, const X& x) = nullptr;
    double lowest_level = 0;
    /// A guard on a tube around the motion. Null: its events are excluded by values.
    Enclosure (*along)(Self, void* adapter, const GuardInMode&,
                       const MotionTube<X>& tube) = nullptr;
    const MeterOptions* metering = nullptr;
};

struct LocatorTable {
    const char* type = "";
    Location (*locate)(const void* self, GuardPath& path, const GuardSample& lo,
                       const GuardSample& hi, double tolerance) = nullptr;
    /// Whether the locator is not called where the series of the guard gives a root.
    bool yields_to_series = false;
};

}  // namespace ricochet::detail
