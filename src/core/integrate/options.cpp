#include "ricochet/options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/require.hpp"

namespace ricochet {

namespace {

/// Whether all numbers are plainly in their ranges, as nearly always, in one test.
[[nodiscard]] bool plainly_valid(const Options& o, bool step_required) noexcept
{
    // NaN and infinity make the sum something else than a number, and 0 times it not zero.
    const double sum = (o.step + o.rtol) + (o.atol + o.h_min) + (o.event_tolerance + o.event_rtol) +
                       o.event_window;
    double least = o.atol;
    for (const double number : {o.step, o.h_min, o.event_tolerance, o.event_rtol, o.event_window}) {
        least = number < least ? number : least;
    }
    return (0 * sum == 0) & (0 * (o.t_end - o.t_start) == 0) & (least >= 0) & (o.rtol > 0) &
           (!step_required | (o.step > 0)) & (o.h_max > o.h_min) & o.component_atol.empty() &
           o.sample_times.empty();
}

}  // namespace

void validate(const Options& options, bool step_required, std::string_view who)
{
    const detail::Require require{who};
    require(std::isfinite(options.t_start), "t_start must be a finite time", options.t_start);
    require(std::isfinite(options.t_end), "t_end must be a finite time", options.t_end);
    detail::validate_but_for_end(options, step_required, who);
}

void detail::validate_but_for_end(const Options& options, bool step_required, std::string_view who)
{
    if (plainly_valid(options, step_required)) return;
    const Refuse refuse_options{who};
    const Require require{who};
    const Options& o = options;
    require(std::isfinite(o.t_start), "t_start must be a finite time", o.t_start);
    require(o.t_end == o.t_end, "t_end must be a finite time", o.t_end);
    if (std::isfinite(o.t_end) && !std::isfinite(o.t_end - o.t_start)) {
        refuse_options(
            fmt::format("t_end - t_start must be finite, got {} - {}", o.t_end, o.t_start));
    }
    if (step_required) {
        require(std::isfinite(o.step) && o.step > 0,
                "step must be positive and finite for a fixed-step run", o.step);
    } else {
        require(std::isfinite(o.step) && o.step >= 0,
                "step must be positive, or zero to have it estimated", o.step);
        require(std::isfinite(o.rtol) && o.rtol >= 0, "rtol must be zero or positive, and finite",
                o.rtol);
        require(std::isfinite(o.atol) && o.atol >= 0, "atol must be zero or positive, and finite",
                o.atol);
        for (const double atol : o.component_atol) {
            require(std::isfinite(atol) && atol >= 0,
                    "every component_atol must be zero or positive, and finite", atol);
        }
        const bool any_zero =
            o.component_atol.empty() ? o.atol == 0 : std::ranges::count(o.component_atol, 0.0) > 0;
        require(o.rtol > 0 || !any_zero, "rtol must be positive where an absolute one is zero",
                o.rtol);
        require(std::isfinite(o.h_min) && o.h_min >= 0,
                "h_min must be zero or positive, and finite", o.h_min);
        require(o.h_max == o.h_max, "h_max must be a length of time, or infinite", o.h_max);
        if (!(o.h_max > o.h_min)) {
            refuse_options(fmt::format("h_max must be above h_min = {}, got {}", o.h_min, o.h_max));
        }
    }
    require(std::isfinite(o.event_tolerance) && o.event_tolerance >= 0,
            "event_tolerance must be zero or positive, and finite", o.event_tolerance);
    require(std::isfinite(o.event_rtol) && o.event_rtol >= 0,
            "event_rtol must be zero or positive, and finite", o.event_rtol);
    require(std::isfinite(o.event_window) && o.event_window >= 0,
            "event_window must be zero or positive, and finite", o.event_window);

    const bool backward = o.t_end < o.t_start;
    double previous = o.t_start;
    for (const double t : o.sample_times) {
        if (backward ? t < o.t_end : t > o.t_end) {
            refuse_options(fmt::format("sample time {} lies beyond the end of the run, t_end = {}",
                                       t, o.t_end));
        }
        if (!(backward ? t <= previous : t >= previous)) {
            refuse_options(fmt::format("sample_times must go from {} towards {}, got {} after {}",
                                       o.t_start, o.t_end, t, previous));
        }
        previous = t;
    }
}

}  // namespace ricochet
