// Internal: the declarations of this header may change without notice.
//
// Decides where a motion goes that has met switching surfaces, or may leave the surfaces on which
// it slides. The rules are stated at `Filippov::reset`.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/filippov_motion.hpp"
#include "ricochet/detail/filippov_rates.hpp"
#include "ricochet/detail/scratch.hpp"

namespace ricochet::detail {

template <class Fields>
class FilippovDecision : public FilippovMotion<Fields> {
    using Motion = FilippovMotion<Fields>;

public:
    using Motion::around, Motion::both, Motion::bit, Motion::flow, Motion::held_on, Motion::only,
        Motion::put, Motion::rate_along, Motion::settle, Motion::surface, Motion::surface_count;

    using Motion::Motion;

    /// The part of a rate that is rounding, or that remains after location made the rate zero,
    /// relative to the largest rate: 2e-13, or 1e-9 where rates are differences.
    template <class X>
    static constexpr double negligible = RatedSurfaces<Fields, X> ? 0x1p-42 : 0x1p-30;

    /// Exits that have fired, a bit each, numbered as in `Exits`.
    using FiredExits = unsigned;

    [[nodiscard]] static constexpr FiredExits exit_bit(std::size_t surface, Place side) noexcept
    {
        return 1u << (2 * surface + (side == Place::above ? 1 : 0));
    }

    /// Places of a motion that starts on the surfaces in `on` without a history.
    template <class X>
    [[nodiscard]] Places decide(const Places& at, Surfaces on, double t, const X& x) const
    {
        if (on == 0) return at;
        return on == both ? decide_on_both({}, t, x) : decide_on_one(at, on, 0, t, x);
    }

    /// The rates below and above as fractions of the larger.
    [[nodiscard]] static std::array<double, 2> scaled(const std::array<double, 2>& rates) noexcept
    {
        const double size = largest_component(rates);
        return size > 0 ? std::array{rates[0] / size, rates[1] / size} : std::array{0.0, 0.0};
    }

    /// The rule of `reset` on one surface.
    template <class X>
    [[nodiscard]] Places decide_on_one(const Places& from, Surfaces on, FiredExits exits, double t,
                                       const X& x) const
    {
        const std::size_t i = only(on);
        const auto rates = [&](double time, const X& at) {
            const RegionRates r = around(on, from, time, at).rates;
            return scaled({r[i][region_of(put(from, i, Place::below))],
                           r[i][region_of(put(from, i, Place::above))]});
        };
        const auto now = rates(t, x);
        Places best = held_on(on, from);
        double fastest = -1;
        for (const Place side : {Place::above, Place::below}) {
            const auto away = [&](const std::array<double, 2>& rate) {
                return side == Place::above ? rate[1] : -rate[0];
            };
            const Places to = put(from, i, side);
            const bool fired = exits & exit_bit(i, side);
            const auto later = [&](double time, const X& at) { return away(rates(time, at)); };
            if (!fired && !leads_away(away(now), to, t, x, later)) continue;
            const double speed = fired ? 0 : greatest_of(away(now), 0.0);
            if (speed > fastest) {
                fastest = speed;
                best = to;
            }
        }
        return best;
    }

    /// The rule of `reset` on two surfaces, from given shares.
    template <class X>
    [[nodiscard]] Places decide_on_both(const Shares& from, double t, const X& x) const
    {
        constexpr Places slides = {Place::sliding, Place::sliding};
        const RegionRates rates = normalised(around(both, slides, t, x).rates);
        const Continuation way = follow_shares(rates, from);
        if (way.to == slides) return slides;
        // A motion that leaves at a rate of zero may turn back. It is followed with the shares with
        // which it leaves, because others may select another exit.
        const auto later = [&](double time, const X& at) {
            const RegionRates r = around(both, slides, time, at).rates;
            const Continuation same = follow_shares(normalised(r), way.at);
            return same.to == way.to ? same.margin : -1;
        };
        return leads_away(way.margin, way.to, t, x, later) ? way.to : slides;
    }

    /// The rule of `reset` on two surfaces after an exit, with the rates and shares a short time
    /// later, as soon as they are beyond doubt. Where the combination has ceased to exist the
    /// shares stay near the place where it did for a time proportional to 1 / sqrt(-apart).
    template <class X>
    [[nodiscard]] Places decide_after_exit(double t, const X& x) const
    {
        constexpr Places slides = {Place::sliding, Place::sliding};
        Places next = slides;
        follow(slides, t, x, [&](double time, const X& later) {
            const RegionRates rates = around(both, slides, time, later).rates;
            const SlidingShares sliding = sliding_shares(rates);
            const auto& [first, second] = sliding.shares;
            const double room = least_of(least_of(first, 1 - first), least_of(second, 1 - second));
            if (room > 0 && sliding.apart > 0) return false;
            next = decide_on_both(sliding.shares, time, later);
            return room < -1e-5 || sliding.apart < -2e-4;
        });
        return next;
    }

    /// Whether an exit leads away from the surface, given its scaled rate. In doubt its motion
    /// is followed until the rate, `later(t, x)`, is clear. A rate whose sign changes within the
    /// resolution of time comes from a state not quite on a surface.
    template <class X, class Later>
    [[nodiscard]] bool leads_away(double rate, const Places& to, double t, const X& x,
                                  const Later& later) const
    {
        if (!(std::fabs(rate) <= negligible<X>)) {
            return rate > 0 && !(a_moment_later(to, t, x, later) < 0);
        }
        double ahead = 0;
        const bool clear = follow(to, t, x, [&](double time, const X& at) {
            ahead = later(time, at);
            return std::fabs(ahead) > 4 * negligible<X>;
        });
        return clear && ahead > 0;
    }

    template <class X, class Later>
    [[nodiscard]] double a_moment_later(const Places& to, double t, const X& x,
                                        const Later& later) const
    {
        Scratch<X, 2> scratch(x);
        X& v = scratch[0];
        X& moved = scratch[1];
        flow(to, t, x, v);
        const TimeScales times(t, largest_component(x), largest_component(v));
        const double moment = 8 * std::numeric_limits<double>::epsilon() * times.longest;
        move(moved, x, moment, v);
        return later(t + moment, moved);
    }

    /// See `Filippov::meeting`.
    template <class X>
    [[nodiscard]] Meeting meeting(std::size_t which, const Places& at, double t, const X& x) const
    {
        const Places up = put(at, which, Place::above);
        const Places down = put(at, which, Place::below);
        const auto rates = [&](double time, const X& there) {
            return scaled(
                {rate_along(which, down, time, there), rate_along(which, up, time, there)});
        };
        const auto now = rates(t, x);
        const bool leaves_up = leads_away(
            now[1], up, t, x, [&](double time, const X& there) { return rates(time, there)[1]; });
        const bool leaves_down = leads_away(-now[0], down, t, x, [&](double time, const X& there) {
            return -rates(time, there)[0];
        });
        if (leaves_up && leaves_down) return Meeting::repulsive;
        if (leaves_up) return Meeting::crossing_up;
        return leaves_down ? Meeting::crossing_down : Meeting::attractive;
    }

    /// Follows a motion along its tangent, over times that grow from almost zero to 1/64
    /// of the longest, until `clear(t, x)` is true.
    template <class X, class Clear>
    bool follow(const Places& at, double t, const X& x, const Clear& clear) const
    {
        Scratch<X, 2> scratch(x);
        X& v = scratch[0];
        X& moved = scratch[1];
        flow(at, t, x, v);
        const TimeScales times(t, largest_component(x), largest_component(v));
        const double most = 0x1p-6 * times.longest;
        for (double s = 0x1p-50 * times.shortest;; s = least_of(16 * s, most)) {
            move(moved, x, s, v);
            if (clear(t + s, moved)) return true;
            if (!(s < most)) return false;
        }
    }

    /// Whether a surface is within a thousandth of the time over which the motion changes.
    template <class X>
    [[nodiscard]] bool is_near(std::size_t which, double t, const X& x) const
    {
        const auto near = around(both, {}, t, x);
        const double rate = largest_component(near.rates[which]);
        const TimeScales times(t, largest_component(x), near.speed);
        return std::fabs(surface(which, t, x)) <= 1e-3 * times.longest * rate;
    }

    /// Takes the decision `decide(x)` exactly on the surfaces in `on`, and then moves x to the
    /// place that was decided.
    template <class X, class Decide>
    [[nodiscard]] Places meet(Surfaces on, const Places& from, double t, X& x,
                              const Decide& decide) const
    {
        Scratch<X, 1> there(x);
        assign(there[0], x);
        const Places all = held_on(on, from);
        settle(on, from, all, t, there[0]);
        const Places next = decide(std::as_const(there[0]));
        if (next == all) {
            assign(x, there[0]);
        } else if (next == from) {
            go_on(on, next, t, x);
        } else {
            settle(on, from, next, t, x);
        }
        return next;
    }

    /// Whether the motion from one surface meets the other one so soon that it counts as having
    /// met both: within the uncertainty of the time of the first meeting.
    template <class X>
    [[nodiscard]] bool meets_other(Surfaces on, const Places& next, double t, const X& x) const
    {
        const std::size_t other = on == bit(0) ? 1 : 0;
        const double h = surface(other, t, x);
        const double rate = rate_along(other, next, t, x);
        const double soon = uncertainty(only(on), next, t, x);
        return h * rate < 0 && std::fabs(h) <= soon * std::fabs(rate);
    }

    /// [s] Uncertainty of the time at which a motion has met a surface: 8 units in the last
    /// place of the time, or for a motion on the wrong side twice the time in which it returns
    /// to its own side, if that is longer.
    template <class X>
    [[nodiscard]] double uncertainty(std::size_t which, const Places& next, double t,
                                     const X& x) const
    {
        const double clock = 8 * std::numeric_limits<double>::epsilon() * std::fabs(t);
        if (!Motion::is_beyond(which, next[which], t, x)) return clock;
        const double h = surface(which, t, x);
        const double rate = rate_along(which, next, t, x);
        return h * rate < 0 ? greatest_of(clock, 2 * std::fabs(h / rate)) : clock;
    }

    /// Moves x along its motion by the smallest possible amount, or onto its own side of the
    /// surfaces in `on`. Where a surface was met but the motion stays on its side, this makes
    /// the loop evaluate the surface again from here.
    template <class X>
    void go_on(Surfaces on, const Places& at, double t, X& x) const
    {
        Scratch<X, 1> v(x);
        flow(at, t, x, v[0]);
        double time = 0;
        for (std::size_t i = 0; i < surface_count; ++i) {
            const bool beyond = (on & bit(i)) && Motion::is_beyond(i, at[i], t, x);
            if (beyond) time = greatest_of(time, uncertainty(i, at, t, x));
        }
        const double speed = largest_component(v[0]);
        for_each_component(x, [&](auto i) {
            const bool fastest = speed > 0 && std::fabs(v[0][i]) == speed;
            if (fastest) x[i] = std::nextafter(x[i], x[i] + v[0][i]);
            x[i] += time * v[0][i];
        });
    }
};

}  // namespace ricochet::detail
