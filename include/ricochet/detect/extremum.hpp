// The honest classical rival: the guard and its rate at both ends of the step.
//
// Where the guard heads for its surface at the start of the step and away from it
// at the end, it has an extremum between; one root-find of the rate on the dense
// output finds it and shows whether the guard has crossed there and come back.
// Smooth guards are caught unless their rate turns more than once within a step.
#pragma once

#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <cstdint>
#include <utility>

#include "ricochet/detect/finding.hpp"

namespace ricochet {

struct Extremum {
    static constexpr bool uses_rates = true;

    template <class Guard, class Step>
    [[nodiscard]] Finding confirm(const Guard& guard, const Step& step, Watch& watch) const
    {
        const double h = step.h();
        const double t1 = step.time(h);
        watch.end = {.s = h,
                     .value = guard.value(t1, step.x1()),
                     .rate = guard.rate(t1, step.x1(), step.rate1(), h)};

        const bool left = has_left(watch.side, watch.end.value);
        if (left && counts(watch.side, guard.crossing())) {
            return Finding::leaving(watch.side, watch.start, watch.end);
        }
        if (left || !turns(watch) || !std::isfinite(watch.start.rate * watch.end.rate)) {
            return Finding::clear(Evidence::checked);
        }
        const GuardSample extremum = find_extremum(guard, step, watch);
        if (!has_left(watch.side, extremum.value)) {
            return Finding::clear(Evidence::checked);
        }
        if (counts(watch.side, guard.crossing())) {
            return Finding::leaving(watch.side, watch.start, extremum);
        }
        return Finding::leaving(opposite(watch.side), extremum, watch.end);
    }

private:
    /// Heading for the surface at the start, away from it at the end.
    [[nodiscard]] static bool turns(const Watch& watch) noexcept
    {
        return (watch.side == Side::above && watch.start.rate < 0 && watch.end.rate > 0) ||
               (watch.side == Side::below && watch.start.rate > 0 && watch.end.rate < 0);
    }

    /// The extremum of the guard between the ends, or the first point met on the
    /// way there at which the guard has left its side.
    template <class Guard, class Step>
    [[nodiscard]] static GuardSample find_extremum(const Guard& guard, const Step& step,
                                                   const Watch& watch)
    {
        typename Guard::State x = step.x0();
        typename Guard::State dxdt = x;
        GuardSample best =
            std::fabs(watch.end.value) < std::fabs(watch.start.value) ? watch.end : watch.start;
        bool left = false;
        const auto rate_at = [&](double s) {
            step.interpolate(s, x);
            step.flow(s, x, dxdt);
            const GuardSample sample{.s = s,
                                     .value = guard.value(step.time(s), x),
                                     .rate = guard.rate(step.time(s), x, dxdt, step.h())};
            if (!left && (has_left(watch.side, sample.value) ||
                          std::fabs(sample.value) < std::fabs(best.value))) {
                best = sample;
                left = has_left(watch.side, sample.value);
            }
            return sample.rate;
        };
        // The guard is flat at its extremum: an offset wrong by 1e-9 h moves its
        // value by 1e-18 h^2 |g''| / 2, far below rounding.
        const double resolution = 1e-9 * step.h();
        std::uintmax_t iterations = 60;
        boost::math::tools::toms748_solve(
            rate_at, watch.start.s, watch.end.s, watch.start.rate, watch.end.rate,
            [&](double a, double b) { return left || b - a <= resolution; }, iterations);
        return best;
    }
};

}  // namespace ricochet
