// Behaviour of a guard between the ends of an interval, from samples in order of time.
//
// Between two consecutive samples the guard is monotone, or away from its surface. A touch
// is a minimum inside the band around the surface, on the way down and up again; a
// minimum below the band is two crossings. Near a minimum that lies at an end of the
// interval, the rate there decides on which side of the end it lies: it is the same
// number in both of the steps that meet there.
#pragma once

#include <cmath>

#include "ricochet/finding.hpp"

namespace ricochet::detail {

class GuardWalk {
public:
    /// Tolerances of a walk: the event band, and the rounding of values.
    struct Scales {
        double band = 0;   ///< |g| that counts as being on the surface
        double noise = 0;  ///< differences of g up to this are rounding
    };

    /// @param at_start the guard on the polynomial at the start of the interval, which may
    ///        lie across the surface where the interval begins at an event
    GuardWalk(const Watch& watch, Crossing crossing, double at_start, const Scales& scales) noexcept
        : watch_(&watch),
          crossing_(crossing),
          scales_(scales),
          side_(watch.side),
          sign_(side_ == Side::above ? 1 : -1),
          at_start_(at_start),
          high_(sign_ * watch.start.value),
          low_(watch.start),
          peak_(watch.start)
    {
        dips_ = high_ <= scales.band;
        const bool heads_in = watch.start.s > 0 || sign_ * watch.start.rate >= 0;
        leaving_start_ = dips_ && heads_in;
        start_is_across_ = leaving_start_ && sign_ * at_start < -scales.band;
        if (leaving_start_ && sign_ * at_start > high_) low_.value = at_start;
    }

    /// Whether an event has been found, and the bracket around it cannot get wider.
    [[nodiscard]] bool decided() const noexcept { return decided_; }
    /// Whether a crossing has been found.
    [[nodiscard]] bool crossed() const noexcept { return crossed_; }
    [[nodiscard]] const Finding& finding() const noexcept { return finding_; }
    [[nodiscard]] Side side() const noexcept { return side_; }

    /// The next sample, inside the interval.
    void pass(const GuardSample& at) noexcept
    {
        const double value = sign_ * at.value;
        if (decided_ || std::isnan(value)) return;
        if (crossed_) {
            if (value > 0) return close();
            if (value < sign_ * low_.value) low_ = at;
        } else if (value > scales_.band) {
            rise(value);
            if (!decided_) go_on_above(at);
        } else if (value >= -scales_.band) {
            stay_in_band(at);
        } else if (!start_is_across_) {
            cross(at);
        }
    }

    /// Ends the bracket: there are no further samples before the end of the interval.
    void close() noexcept
    {
        decided_ = true;
        finding_ = Finding::leaving(side_, from_, low_);
    }

    /// The end of the interval. @param heading direction of a guard that is on its surface there:
    /// 1, to its side; -1, across; 0, not known
    void end(const GuardSample& at, int heading) noexcept
    {
        const double value = sign_ * at.value;
        if (decided_ || std::isnan(value)) return;
        if (crossed_) {
            if (value < -scales_.band) low_ = at;
            return close();
        }
        if (std::fabs(value) <= scales_.band) return end_in_band(at, heading);
        start_is_across_ = false;
        pass(at);
        if (crossed_ && !decided_) close();
    }

private:
    /// Leaves the band upwards, with the value `value`.
    void rise(double value) noexcept
    {
        if (dips_ && !leaving_start_ && value > sign_ * low_.value + scales_.noise) touch(low_);
    }

    void go_on_above(const GuardSample& at) noexcept
    {
        dips_ = leaving_start_ = start_is_across_ = false;
        high_ = sign_ * at.value;
        if (high_ > sign_ * peak_.value) peak_ = at;
    }

    void stay_in_band(const GuardSample& at) noexcept
    {
        const double value = sign_ * at.value;
        if (!dips_) {
            high_ = std::fmax(high_, value);
            dips_ = value < high_ - scales_.noise;
            low_ = at;
        } else if (value <= sign_ * low_.value) {
            low_ = at;
        } else if (value > 0 && value > sign_ * low_.value + scales_.noise) {
            rise(value);
            if (!decided_) go_on_above(at);
        }
    }

    /// Takes a sample before which the guard has left its side.
    void cross(const GuardSample& at) noexcept
    {
        from_ = flipped_ || starts_flat(at.s) ? peak_ : watch_->start;
        if (counts(side_, crossing_)) {
            crossed_ = true;
            low_ = at;
            return;
        }
        side_ = opposite(side_);
        sign_ = -sign_;
        flipped_ = true;
        peak_ = at;
        go_on_above(at);
    }

    /// Whether the guard starts on its surface and is across it or takes more than a millionth of
    /// the interval to leave it: then the start is no bound of a bracket around another root.
    [[nodiscard]] bool starts_flat(double until) const noexcept
    {
        const GuardSample& start = watch_->start;
        if (std::fabs(start.value) > scales_.band) return false;
        return sign_ * at_start_ < 0 ||
               !(sign_ * start.rate * (until - start.s) > 1e6 * scales_.band);
    }

    void touch(const GuardSample& at) noexcept
    {
        if (!counts(side_, crossing_)) return;
        decided_ = true;
        finding_ = Finding::touching(side_, at);
    }

    /// Ends on the surface: the guard crosses there, has turned, or will turn, which the next
    /// step will decide.
    void end_in_band(const GuardSample& at, int heading) noexcept
    {
        const double value = sign_ * at.value;
        const double rate = sign_ * at.rate;
        if (heading < 0 || (heading == 0 && rate <= 0)) {
            if (value > 0) return;
            cross(at);
            if (crossed_) close();
        } else if (rate >= 0 && !leaving_start_ && (dips_ || value < high_ - scales_.noise)) {
            touch(dips_ && sign_ * low_.value <= value ? low_ : at);
        }
    }

    const Watch* watch_;
    Crossing crossing_;
    Scales scales_;
    Side side_;
    double sign_;
    double at_start_;
    double high_;                 ///< highest since the last dip into the band
    GuardSample low_;             ///< bottom of the dip; after a crossing, the lowest sample across
    GuardSample peak_;            ///< highest sample since the last change of side
    GuardSample from_;            ///< last sample on the side before the crossing
    bool dips_ = false;           ///< whether the guard is in the band, and lower than before
    bool leaving_start_ = false;  ///< whether it started on the surface, and has not left it yet
    bool start_is_across_ = false;
    bool flipped_ = false;
    bool crossed_ = false;
    bool decided_ = false;
    Finding finding_;
};

}  // namespace ricochet::detail
