// Detection of accumulating events of a guard.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "ricochet/instant.hpp"
#include "ricochet/step_probe.hpp"

namespace ricochet::detail {

/// Recognises accumulating events: three consecutive intervals that shrink, with a
/// geometric remainder d q / (1 - q) that is no longer worth resolving, or with excursions of
/// the guard between two events that are lost in its rounding; also events that do not advance
/// time at all. Sequences of regular events, however fast, keep a remainder that is worth
/// resolving and excursions that can be distinguished from rounding.
class ShrinkingIntervals {
public:
    /// Records an event at `t`, where a step would be of length `step` [s]; true
    /// after more than a hundred in a row that the time does not distinguish.
    [[nodiscard]] bool stalls(const Instant& t, double step) noexcept
    {
        step_ = step;
        const double interval =
            std::fabs((t.value - last_.value) + (t.remainder - last_.remainder));
        stalled_ = interval < std::max(resolution(), std::numeric_limits<double>::min()) / 4
                       ? stalled_ + 1
                       : 0;
        if (stalled_ > most_at_once) return true;
        const double instant = std::max(resolution(), std::numeric_limits<double>::min()) / 256;
        if (interval <= instant && seen_ > 0) {  // another event of the same instant: no interval
            last_ = t;
            return false;
        }
        shrinking_ = seen_ >= 2 && interval < interval_ ? shrinking_ + 1 : 0;
        if (seen_ >= 2 && interval > interval_ && interval < longest_ / 32) {
            longer_ = interval;
            since_longer_ = 0;
        } else if (longer_ > 0 && ++since_longer_ > 16) {
            longer_ = 0;
        }
        const double ratio = shrinking_ > 0 ? interval / interval_ : 1;
        surprise_ = shrinking_ > 1 ? std::fabs(interval - interval_ * ratio_) : 0;
        geometric_ = interval + 4 * resolution() >= interval_ * ratio_ / 16;
        ratio_ = ratio;
        last_ = t;
        interval_ = interval;
        seen_ = std::min(seen_ + 1, 2u);
        if (seen_ == 2) longest_ = std::max(longest_, interval);
        return false;
    }

    /// Begins to count the events at one time again: they are far apart in the guard, as those of a
    /// queue that is served at one instant.
    void forget_stall() noexcept { stalled_ = 0; }

    /// Starts again after the motion has come to rest. Events that do not advance the time are
    /// counted on: a rest need not end them.
    void come_to_rest() noexcept
    {
        ShrinkingIntervals fresh;
        if (stalled_ > most_at_once) {
            fresh.last_ = last_;
            fresh.stalled_ = stalled_;
        }
        *this = fresh;
    }

    /// Whether the time has not advanced although the motion has come to rest a hundred times.
    [[nodiscard]] bool outlast_rest() const noexcept { return stalled_ > 2 * most_at_once; }

    /// Whether a guard that leaves its surface at `rate` [1/s] after the event just recorded
    /// will rise so little, or so briefly, compared with earlier excursions, that its
    /// rounding may matter.
    [[nodiscard]] bool is_low_at(double rate) const noexcept
    {
        return seen_ >= 2 && (rise(rate) <= 1e-3 * peak_ || interval_ <= 0.03 * longest_);
    }

    /// Records that the guard turns back from its surface at `rate` [1/s] after that event, and
    /// whether that is `low`; infinity: it does not turn back.
    void depart(double rate, bool low) noexcept
    {
        excursion_ = seen_ >= 2 ? rise(rate) : std::numeric_limits<double>::infinity();
        low_ = low;
        if (!std::isfinite(excursion_)) return;
        peak_ = std::max(peak_, excursion_);
        decay_ = 1 - excursion_ / last_excursion_;
        last_excursion_ = excursion_;
        if (!low) usual_decay_ = decay_;
    }

    /// Whether the last departure was low.
    [[nodiscard]] bool is_low() const noexcept { return low_; }

    /// Interval [s] between the last two events.
    [[nodiscard]] double interval() const noexcept { return interval_; }

    /// Whether excursions are lost in the guard's `rounding`: at the end of a shrinking series,
    /// or three in a row. The error that a reset leaves in the guard adds to every excursion: with
    /// restitution e they stay at 1 / (1 - e^2) times the error, and from twice that size on they
    /// decay less than half as fast.
    [[nodiscard]] bool fades(double rounding) noexcept
    {
        const bool sunk = excursion_ <= rounding;
        const bool lingers = excursion_ <= 32 * rounding && decay_ < usual_decay_ / 2;
        sunk_ = sunk || lingers ? sunk_ + 1 : 0;
        return sunk_ >= 3 || (sunk && shrinking_ >= 3);
    }

    /// Records how far a reset put the guard back from its surface, while the guard still moves
    /// towards it; true if such jumps have fallen for three events, to a thousandth, and are now
    /// lost in the guard's `rounding`: the next crossing exists, but is no longer seen.
    [[nodiscard]] bool jump_is_lost(double away, double rounding) noexcept
    {
        if (away > 32 * rounding) {
            falls_ = away < jump_ ? falls_ + 1 : 0;
            highest_jump_ = falls_ > 0 ? highest_jump_ : away;
            jump_ = away;
        }
        if (away > rounding) return false;    // the last jumps may differ by the error of location
        const bool near = away >= -rounding;  // farther, the reset has put it beyond its surface
        return std::exchange(falls_, 0) >= 3 && near && highest_jump_ >= 1024 * rounding;
    }
    void forget_jumps() noexcept { falls_ = 0; }

    /// Whether the remainder after the event just recorded is below `tolerance` [s] or
    /// the resolution of its time. An interval that is far shorter than the previous ones
    /// suggest is the gap between two events, not the end of a series.
    ///
    /// An event that is located late by d, and whose reset puts the motion back on the surface,
    /// gains speed: intervals with the ratio q then stay at 2 q d / (1 - q), and from twice that
    /// length on they shrink less than half as fast.
    [[nodiscard]] bool accumulate(double tolerance) noexcept
    {
        if (shrinking_ >= 3 && geometric_ && remainder() < std::max(tolerance, resolution())) {
            return true;
        }
        const bool shrinks = shrinking_ >= 3 && ratio_ < 0.999;
        if (shrinks && interval_ * (1 - ratio_) > 16 * tolerance * ratio_) usual_ratio_ = ratio_;
        if (tolerance == 0) return false;
        const double decay = 1 - usual_ratio_;
        const bool lingers = interval_ * decay <= 5 * late_ * usual_ratio_ &&
                             1 - ratio_ < decay / 2 && interval_ <= longest_ / 4;
        lingering_ = lingers ? lingering_ + 1 : 0;
        return lingering_ >= 3;
    }

    /// Records that the time of the last event is known to `error` [s], or lies anywhere in the
    /// last interval.
    void blame(double error) noexcept
    {
        assert(!(error < 0));
        late_ = std::fmin(error, interval_);
        blamed_ += late_;
    }

    /// Uncertainty [s] of the limit: an event that is late by d delays all later ones by
    /// d (1 + q) / (1 - q) in the end. Intervals that have not always shrunk may be a few of many
    /// in a round of another guard.
    [[nodiscard]] double error() const noexcept
    {
        const double q = std::min(usual_ratio_, ratio_);
        return remainder() + (q < 1 ? blamed_ * (1 + q) / (1 - q) : blamed_) +
               (lingering_ > 0 ? interval_ / (1 - q) : 0) + 32 * longer_ +
               (q < 1 ? (4 * surprise_ + unresolved()) / (1 - q) : 0);
    }

    /// Extrapolated time [s] from the last event to the limit of all; 0 if the intervals
    /// do not shrink, or only because events are late.
    [[nodiscard]] double remainder() const noexcept
    {
        return ratio_ < 1 && lingering_ < 3 ? interval_ * ratio_ / (1 - ratio_) : 0;
    }

    /// Calls `visit` with every number of the state.
    template <class Visit>
    void visit(Visit&& visit)
    {
        visit(last_.value);
        visit(last_.remainder);
        visit(interval_);
        visit(ratio_);
        visit(seen_);
        visit(shrinking_);
        visit(stalled_);
        visit(step_);
        visit(geometric_);
        visit(excursion_);
        visit(last_excursion_);
        visit(peak_);
        visit(longest_);
        visit(decay_);
        visit(usual_decay_);
        visit(usual_ratio_);
        visit(late_);
        visit(blamed_);
        visit(lingering_);
        visit(sunk_);
        visit(longer_);
        visit(since_longer_);
        visit(surprise_);
        visit(low_);
        visit(jump_);
        visit(highest_jump_);
        visit(falls_);
    }

private:
    static constexpr std::uint32_t most_at_once = 100;  ///< events that do not advance the time

    /// Height of the next excursion: a parabola that leaves at `rate`, for an interval that
    /// shrinks as the last one did, rises by rate * interval / 4.
    [[nodiscard]] double rise(double rate) const noexcept
    {
        return std::fabs(rate) * interval_ * ratio_ / 4;
    }

    /// Time [s] that the last interval between distinguishable events leaves open once rounding
    /// decides; before, 0.
    [[nodiscard]] double unresolved() const noexcept
    {
        return stalled_ > most_at_once ? 8 * interval_ : sunk_ > 0 ? 2 * interval_ : 0;
    }

    [[nodiscard]] double resolution() const noexcept
    {
        return 16 * finest_bracket(last_.value, step_);
    }

    Instant last_;
    double interval_ = 0;
    double ratio_ = 1;
    double step_ = 0;
    bool geometric_ = true;
    std::uint32_t seen_ = 0;
    std::uint32_t shrinking_ = 0;
    std::uint32_t stalled_ = 0;
    double excursion_ = std::numeric_limits<double>::infinity();  ///< expected size of the next
    double last_excursion_ = std::numeric_limits<double>::infinity();
    double peak_ = 0;         ///< the largest excursion
    double longest_ = 0;      ///< [s] longest interval
    double decay_ = 0;        ///< fraction that the last excursion lost of the one before
    double usual_decay_ = 0;  ///< decay before rounding mattered
    double usual_ratio_ = 1;  ///< ratio of intervals before lateness mattered
    double late_ = 0;         ///< [s] error of the last event
    double blamed_ = 0;       ///< [s] sum of all such errors
    double longer_ = 0;       ///< [s] a late interval that was longer than the one before it
    double surprise_ = 0;     ///< [s] by which the last one differs from what earlier ones predict
    std::uint32_t since_longer_ = 0;  ///< number of intervals since then
    std::uint32_t lingering_ = 0;
    std::uint32_t sunk_ = 0;
    bool low_ = false;
    double jump_ = 0;          ///< how far the last reset put the guard back
    double highest_jump_ = 0;  ///< the first jump of the falling sequence
    std::uint32_t falls_ = 0;
};

}  // namespace ricochet::detail
