// Accumulation of a cycle of events: rows of events whose excursions are lost in rounding.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "core/tolerances.hpp"
#include "ricochet/instant.hpp"

namespace ricochet::detail {

/// What rounding takes from the time to a limit. Where rounding moves a guard by d, each event
/// takes the part d / size of the energy of its excursion. These parts grow as excursions decay,
/// and the motion ends where their sum is 1: after an event of that part, and a motion that loses
/// the part `decay` of its energy in each round, the root of part / decay of the remaining time is
/// lost at the end, and about as much by shorter flights before. Half a unit in the last place is a
/// 16th of the `rounding` of the engine, of 8 such units, so that of the remaining time
///
///     2 sqrt(rounding / (16 size decay))
///
/// is lost. All excursions to one surface at one acceleration give the same; of several, the one
/// with the largest loss counts.
class LossByRounding {
public:
    /// Records the excursion of that size that ended at t [s] after an interval [s]. If the guard
    /// has several surfaces, one in each mode, each has its own rounding.
    void see(double t, double interval, double size, double rounding) noexcept
    {
        if (!(size > 0)) return;
        // Where the rate does not fall as excursions do, as of levels, no energy is lost; where
        // they grow, another motion has begun.
        const double rate = size / interval;
        const double steepness = rate * rate * (rate * rate) / size;
        if (!(steepness < steepest_)) {
            if (size < size_) return;
            steepest_ = steepness;
            weight_ = part_ = 0;
            return;
        }
        const double weight = rounding * rate / interval;
        if (!(2 * weight >= weight_)) return;
        const double decay = size < size_ ? 1 - size / size_ : 1;
        size_ = size;
        const double part = std::sqrt(rounding / (4 * size * decay));
        if (!(part <= 0.25)) return;  // rounding already decides
        t_ = t;
        weight_ = weight;
        part_ = part;
    }
    /// Time [s] that rounding takes from a motion that was seen to end at t [s].
    [[nodiscard]] double time(double t) const noexcept
    {
        return part_ / (1 - part_) * std::fabs(t - t_);
    }

    template <class Visit>
    void visit(Visit&& visit)
    {
        visit(t_);
        visit(size_);
        visit(weight_);
        visit(part_);
        visit(steepest_);
    }

private:
    double t_ = 0;       ///< [s] end of the excursion
    double size_ = 0;    ///< of it, or of the last one
    double weight_ = 0;  ///< rounding times acceleration, of which the loss is the root
    double part_ = 0;    ///< of the remaining time that is lost
    double steepest_ = 0;
};

/// Excursions of one guard from its surface, from one acting instant to its event at the next.
class Excursions {
public:
    /// Whether the rounding of the guard has to be computed for an excursion of that size. It
    /// changes slowly, and is computed again only after some excursions, or when they are small.
    [[nodiscard]] bool wants_rounding(double size) const noexcept
    {
        return !(size > tolerances::of_fading * rounding_ && age_ < most_age);
    }
    void keep_rounding() noexcept { ++age_; }
    void set_rounding(double rounding) noexcept
    {
        rounding_ = rounding;
        age_ = 0;
    }
    [[nodiscard]] double rounding() const noexcept { return rounding_; }

    /// Records an excursion of that size, too large to be lost. Returns its size as a part of the
    /// one before.
    double pass(double size) noexcept
    {
        lost_ = 0;
        if (!(size > 0)) return 1;
        const double last = std::exchange(last_, size);
        const double part = size / last;
        // A far smaller excursion may begin another motion. A larger one does so only where it is
        // not small beside the largest: rounding of other guards may have sustained it.
        if (part > 0) fallen_ = std::min(fallen_ * std::max(part, 1.0 / 64), 1.0);
        return part;
    }
    /// Records an excursion that has not been seen at all: the guard had its next event at time t
    /// [s], the instant of the event before.
    void vanish(double t) noexcept
    {
        if (lost_++ == 0) lost_from_ = end_;
        end_ = t;
    }
    /// Records an excursion of that size. False: it is neither lost in the rounding of the guard,
    /// nor has it fallen to a thousandth.
    [[nodiscard]] bool fall(double size) noexcept
    {
        const std::uint32_t lost_before = lost_;
        const double part = pass(size);
        if (size > 64 * rounding_) usual_decay_ = 1 - part;
        // What a reset leaves on the guard adds to each excursion: they end up as a multiple of it,
        // and from twice that size on they decay less than half as fast.
        const bool lost =
            size < rounding_ || (size <= 32 * rounding_ && 1 - part < usual_decay_ / 2);
        lost_ = lost ? lost_before + 1 : 0;
        return lost || has_fallen();
    }
    /// Whether excursions have fallen to a thousandth, in more than one step.
    [[nodiscard]] bool has_fallen() const noexcept { return fallen_ <= 0x1p-10; }
    /// Number of the last excursions in a row that have been lost.
    [[nodiscard]] std::uint32_t lost() const noexcept { return lost_; }

    [[nodiscard]] LossByRounding& loss() noexcept { return loss_; }

    /// Records that the last excursion ended at t [s], and the rate [1/s] of the guard there.
    void end(double t, double slope) noexcept
    {
        if (lost_ == 1) lost_from_ = t;
        end_ = t;
        slope_ = slope;
    }
    /// Time [s] at which the last excursion ended.
    [[nodiscard]] double end() const noexcept { return end_; }
    /// Uncertainty [s] of the limit at time t. While excursions are lost, it is the time since they
    /// are, and what was left then; else what the rounding of one event adds to all later ones. It
    /// is at least the loss by all excursions. Speeds, and with them intervals, fall by the root of
    /// what excursions do.
    [[nodiscard]] double error(double t) const noexcept
    {
        const double q = std::sqrt(std::clamp(1 - usual_decay_, 0.0, 0.98));
        const double sum = (1 + q) / (1 - q);
        const double least = loss_.time(t);
        if (lost_ > 0) return std::max(2 * std::fabs(t - lost_from_) * sum, least);
        const double late = std::fabs(rounding_ / (4 * slope_)) * sum / (1 - q);
        return std::isfinite(late) ? std::max(late, least) : least;  // of a rate that is not known
    }

    /// How often the guard occurs in a row, this time included.
    [[nodiscard]] std::uint32_t occur(std::uint32_t row) noexcept
    {
        return times_ = std::exchange(row_, row) == row ? times_ + 1 : 1;
    }

    /// Calls `visit` with every number of the state.
    template <class Visit>
    void visit(Visit&& visit)
    {
        visit(last_);
        visit(fallen_);
        visit(usual_decay_);
        visit(rounding_);
        visit(age_);
        visit(lost_);
        visit(slope_);
        visit(lost_from_);
        visit(end_);
        visit(row_);
        visit(times_);
        loss_.visit(visit);
    }

private:
    static constexpr std::uint32_t most_age = 64;

    double last_ = std::numeric_limits<double>::infinity();
    double fallen_ = 1;       ///< the last one as a part of the largest
    double usual_decay_ = 0;  ///< fraction of the last that was lost before rounding mattered
    double rounding_ = 0;
    std::uint32_t age_ = most_age;  ///< number of excursions since that was determined
    std::uint32_t lost_ = 0;
    double slope_ = 0;
    double lost_from_ = 0;                                   ///< [s] time since when they are lost
    double end_ = -std::numeric_limits<double>::infinity();  ///< [s] of the last one
    std::uint32_t row_ = 0, times_ = 0;
    LossByRounding loss_;
};

/// Row of acting instants, one after the other, at each of which the excursion of the guard was
/// lost or had fallen to a thousandth. Once each of its guards occurs in it three times, the cycle
/// has reached its limit at a guard whose excursions were all lost: if only some are, the rounding
/// of their guards alone sustains the others.
class LostRow {
public:
    /// Whether an acting instant follows the one before so soon that excursions may be lost.
    [[nodiscard]] bool follows_soon(const Instant& t) noexcept
    {
        interval_ = interval_to(t);
        last_ = t;
        if (!std::exchange(started_, true)) return false;
        const bool soon = interval_ <= longest_ / 32;
        longest_ = std::max(longest_, interval_);
        quick_ = soon ? quick_ + 1 : 0;
        return quick_ >= 3;
    }
    /// Whether an acting instant at t would follow the one before so soon.
    [[nodiscard]] bool would_follow_soon(const Instant& t) const noexcept
    {
        return started_ && interval_to(t) <= longest_ / 32 && quick_ >= 2;
    }
    /// [s] from the last acting instant to t.
    [[nodiscard]] double interval_to(const Instant& t) const noexcept
    {
        return std::fabs((t.value - last_.value) + (t.remainder - last_.remainder));
    }
    /// [s] since the acting instant before.
    [[nodiscard]] double interval() const noexcept { return interval_; }

    [[nodiscard]] bool is_empty() const noexcept { return guards_ == 0; }
    void clear() noexcept
    {
        if (guards_ == 0) return;
        ++row_;
        guards_ = complete_ = 0;
        all_lost_ = true;
    }

    void add(Excursions& guard) noexcept
    {
        if (guards_ == 0) from_ = last_;
        const std::uint32_t times = guard.occur(row_);
        guards_ += times == 1;
        complete_ += times == least;
        all_lost_ = all_lost_ && guard.lost() > 0;
    }
    /// Whether the row ends with this guard, just added.
    [[nodiscard]] bool ends_with(const Excursions& guard) const noexcept
    {
        return guards_ > 0 && complete_ == guards_ && guard.lost() >= least &&
               (all_lost_ || guard.has_fallen());
    }
    /// [s]
    [[nodiscard]] double length() const noexcept { return std::fabs(last_.until(from_.value)); }

    /// Calls `visit` with every number of the state.
    template <class Visit>
    void visit(Visit&& visit)
    {
        visit(last_.value);
        visit(last_.remainder);
        visit(from_.value);
        visit(from_.remainder);
        visit(interval_);
        visit(longest_);
        visit(quick_);
        visit(row_);
        visit(guards_);
        visit(complete_);
        visit(started_);
        visit(all_lost_);
    }

private:
    static constexpr std::uint32_t least = 3;

    Instant last_, from_;
    double interval_ = 0, longest_ = 0;
    std::uint32_t quick_ = 0, row_ = 1, guards_ = 0, complete_ = 0;
    bool started_ = false, all_lost_ = true;
};

}  // namespace ricochet::detail
