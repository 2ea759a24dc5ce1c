#include "ricochet/integrate/options.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace ricochet {

namespace {

void require(bool fulfilled, const char* option, double given, const char* expected)
{
    if (!fulfilled) {
        throw std::invalid_argument(
            fmt::format("integrate: {} must be {}, got {}", option, expected, given));
    }
}

}  // namespace

void validate(const Options& options, bool step_required)
{
    const Options& o = options;
    require(std::isfinite(o.t_start), "t_start", o.t_start, "a finite time");
    require(std::isfinite(o.t_end), "t_end", o.t_end, "a finite time");
    if (!std::isfinite(o.t_end - o.t_start)) {
        throw std::invalid_argument(fmt::format(
            "integrate: t_end - t_start must be finite, got {} - {}", o.t_end, o.t_start));
    }
    if (step_required) {
        require(std::isfinite(o.step) && o.step > 0, "step", o.step,
                "positive and finite for a fixed-step run");
    } else {
        require(std::isfinite(o.step) && o.step >= 0, "step", o.step,
                "positive, or zero to have it estimated");
        require(std::isfinite(o.rtol) && o.rtol >= 0, "rtol", o.rtol, "zero or positive");
        require(std::isfinite(o.atol) && o.atol >= 0, "atol", o.atol, "zero or positive");
        require(o.rtol > 0 || o.atol > 0, "rtol", o.rtol, "positive where atol is zero");
        require(std::isfinite(o.h_min) && o.h_min >= 0, "h_min", o.h_min, "zero or positive");
        require(o.h_max > o.h_min, "h_max", o.h_max, "above h_min");
    }
    require(std::isfinite(o.event_tolerance) && o.event_tolerance >= 0, "event_tolerance",
            o.event_tolerance, "zero or positive");
    require(std::isfinite(o.event_rtol) && o.event_rtol >= 0, "event_rtol", o.event_rtol,
            "zero or positive");
    require(std::isfinite(o.event_window) && o.event_window >= 0, "event_window", o.event_window,
            "zero or positive");

    const bool backward = o.t_end < o.t_start;
    double previous = o.t_start;
    for (const double t : o.sample_times) {
        if (backward ? t < o.t_end : t > o.t_end) {
            throw std::invalid_argument(
                fmt::format("integrate: sample time {} lies beyond the end of the run, t_end = {}",
                            t, o.t_end));
        }
        if (!(backward ? t <= previous : t >= previous)) {
            throw std::invalid_argument(
                fmt::format("integrate: sample_times must go from {} towards {}, got {} after {}",
                            o.t_start, o.t_end, t, previous));
        }
        previous = t;
    }
}

}  // namespace ricochet
