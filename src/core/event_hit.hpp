// Resolution of a search for events, and the hits that it finds.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "core/tolerances.hpp"
#include "ricochet/detail/cubic_check.hpp"
#include "ricochet/detail/detector_table.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/options.hpp"
#include "ricochet/step_probe.hpp"

namespace ricochet::detail {

/// Resolution of events at a given time.
class EventResolution {
public:
    explicit EventResolution(const Options& options) noexcept
        : absolute_(options.event_tolerance),
          relative_(options.event_rtol),
          window_(options.event_window)
    {
    }

    /// Width [s] of a bracket that is narrow enough.
    [[nodiscard]] double tolerance(double t) const noexcept
    {
        return absolute_ + relative_ * std::fabs(t);
    }

    /// Whether events are located to neighbouring doubles at any time.
    [[nodiscard]] bool is_finest() const noexcept { return absolute_ == 0 && relative_ == 0; }

    /// Distance in time [s] up to which two events cannot be told apart.
    [[nodiscard]] double blur(double t) const noexcept
    {
        return std::max(tolerance(t), tolerances::of_time * std::fabs(t));
    }

    /// Distance in time [s] up to which two events happen together.
    [[nodiscard]] double window(double t) const noexcept { return std::max(blur(t), window_); }

private:
    double absolute_, relative_, window_;
};

/// An event that changes nothing, found inside a step.
struct Note {
    std::size_t guard = 0;
    EventKind kind = EventKind::crossing;
    Side side = Side::plateau;  ///< the side that the guard left
    Location where;
    std::size_t state = std::numeric_limits<std::size_t>::max();  ///< index of its state, if kept
};

/// Halves a bracket by the sides of the guard alone, down to the tolerance or neighbouring doubles.
void bisect(GuardPath& path, GuardSample& lo, GuardSample& hi, double tolerance);

/// The fractions of a step at which guards are evaluated whose values carry only a sign: those at
/// which other guards are evaluated too, and a longer list in a step so long that few of its length
/// make the run.
class SignChecks {
public:
    static constexpr std::size_t most = CubicCheck::places.size() + 1;

    template <class X>
    SignChecks(const DetectorTable<X>& detector, bool left_out, const Options& options) noexcept
        : everywhere_(detector.screening == Screening::every),
          inside_(detector.checks_inside && options.check_inside && !left_out),
          long_(std::fabs(options.t_end - options.t_start) / 16)
    {
    }

    /// Whether all places are asked for by the length of the step.
    [[nodiscard]] bool is_long(double h) const noexcept { return inside_ && std::fabs(h) > long_; }

    /// The places for a search. `everywhere`: guards have been evaluated at all of them.
    [[nodiscard]] std::span<const double> places(double h, bool everywhere) const noexcept
    {
        if (everywhere_ || everywhere || is_long(h)) return all;
        return std::span(few).first(inside_ ? few.size() : 0);
    }
    /// The places for a step that is screened guard by guard.
    [[nodiscard]] std::span<const double> places_screened(double h) const noexcept
    {
        return is_long(h) ? std::span<const double>(all) : std::span(few).first(inside_ ? 1 : 0);
    }

private:
    static constexpr std::array few = {CubicCheck::inside, CubicCheck::further};
    static constexpr std::array<double, most> all = [] {
        std::array<double, most> places{};
        std::copy(CubicCheck::places.begin(), CubicCheck::places.end(), places.begin());
        places.back() = CubicCheck::inside;
        std::sort(places.begin(), places.end());
        return places;
    }();

    bool everywhere_;
    bool inside_;
    double long_;  ///< [s]
};

/// Drops the recorded crossings beyond the offset s, and sorts the others by time.
void sort_notes_until(double s, std::vector<Note>& notes);

/// Change of sign of a guard at a place that a locator found.
[[nodiscard]] inline EventKind kind_of(const Location& where) noexcept
{
    return where.jump ? EventKind::jump : EventKind::crossing;
}

/// A departure of an acting guard from its side inside a step.
struct Hit {
    std::size_t guard = 0;
    Side side = Side::plateau;  ///< the side that the guard leaves
    Finding finding;
    double guess = 0;       ///< [s] estimated offset of the root
    bool departed = false;  ///< it is to be located
    double value = 0;       ///< if not: the guard at the end of the window
    bool located = false;
    Location where;
};

/// Events of a guard that follow each other in one step and hardly advance: the guard is zero by
/// rounding at many neighbouring offsets, and its rates contradict that, as with a flow that jumps
/// there, or near tangency in a long step. The search then continues behind them.
class Creep {
public:
    explicit Creep(double h) noexcept : reach_(tolerances::of_creep * std::fabs(h)) {}

    /// Whether the event at the offset `root`, after one at `from`, is one too many of them.
    [[nodiscard]] bool is_too_long(double from, double root) noexcept
    {
        count_ = from > 0 && root - from <= reach_ ? count_ + 1 : 0;
        return count_ > 8;
    }
    /// Offset at which the search continues after the event at `root`; further away each time.
    [[nodiscard]] double behind(double root) noexcept
    {
        const double behind = root + reach_;
        reach_ *= 2;
        count_ = 0;
        return behind;
    }

private:
    int count_ = 0;
    double reach_;  ///< [s]
};

/// The detector and the locator of a run.
template <class X>
struct Finders {
    const DetectorTable<X>& detector;
    const void* detecting;
    const LocatorTable& locator;
    const void* locating;

    [[nodiscard]] Finding examine(GuardPath& path, Watch& watch) const
    {
        return detector.examine(detecting, path, watch);
    }
    [[nodiscard]] Location locate(GuardPath& path, const GuardSample& lo, const GuardSample& hi,
                                  double tolerance) const
    {
        return locator.locate(locating, path, lo, hi, tolerance);
    }
    [[nodiscard]] bool leaves_plainly(double sign, const GuardSample& start, const GuardSample& end,
                                      double touch) const
    {
        return detector.leaves_plainly(sign, start, end, touch);
    }
};

}  // namespace ricochet::detail
