// A step of a C program's integrator, in the engine's terms.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>

#include "bindings/c/callback_system.hpp"
#include "bindings/c/results.hpp"
#include "ricochet/detail/host_step.hpp"
#include "ricochet/monitor.hpp"

namespace ricochet::c {

/// If the host gives no interpolant, the step is the cubic through its ends.
class ShownStep {
public:
    /// @throws Refusal naming what is missing.
    ShownStep(const rc_host_step& given, std::size_t dimension, bool backward)
        : given_(given),
          sign_(backward ? -1 : 1),
          cubic_({given.t0, given.t0_remainder}, given.h, view(given.x0), view(given.x1),
                 view(given.rate0), view(given.rate1))
    {
        const auto require = [](bool fulfilled, const char* message) {
            if (!fulfilled) throw Refusal(RC_INVALID, std::string("rc_host_step: ") + message);
        };
        require_dimension("rc_host_step", given.n, dimension);
        require(given.x0 && given.x1, "found null for x0 or x1; expected the states at its ends");
        require(given.rate0 && given.rate1,
                "found null for rate0 or rate1; expected the rates at its ends");
        require(given.interpolate || !given.interpolate_rate,
                "found an interpolate_rate without an interpolate");
        // Largest gap that is allowed between a step and the end of the previous one.
        const double rounding =
            4 * std::numeric_limits<double>::epsilon() * std::fabs(given.t0) + 1e-9 * given.h;
        require(given.t0_remainder == 0 || std::fabs(given.t0_remainder) <= rounding,
                "found a t0_remainder that is more than rounding takes from t0");
        require_finite("rc_host_step", "x1", given.x1, dimension);
        require_finite("rc_host_step", "rate0", given.rate0, dimension);
        require_finite("rc_host_step", "rate1", given.rate1, dimension);
    }

    /// Refers to this object.
    [[nodiscard]] detail::HostStepTable table() const noexcept
    {
        detail::HostStepTable table{.t = given_.t0,
                                    .h = given_.h,
                                    .x0 = given_.x0,
                                    .x1 = given_.x1,
                                    .rate0 = given_.rate0,
                                    .rate1 = given_.rate1,
                                    .host = this,
                                    .interpolate = &interpolate,
                                    .t_remainder = given_.t0_remainder,
                                    .is_cubic = !given_.interpolate};
        if (given_.interpolate_rate || !given_.interpolate) table.rate = &interpolate_rate;
        if (given_.restep) table.restep = &restep;
        return table;
    }

private:
    [[nodiscard]] std::span<const double> view(const double* x) const noexcept
    {
        return {x, x ? given_.n : 0};
    }
    void call(rc_offset_fn function, const char* name, double s, double* x, std::size_t n) const
    {
        heed(function(given_.user, s, x, n), name, given_.t0 + sign_ * s);
    }

    static void interpolate(const void* host, double s, double* x, std::size_t n)
    {
        const auto& step = *static_cast<const ShownStep*>(host);
        const rc_offset_fn own = step.given_.interpolate;
        own ? step.call(own, "interpolate", s, x, n) : step.cubic_.interpolate(s, {x, n});
    }
    static void interpolate_rate(const void* host, double s, double* dxdt, std::size_t n)
    {
        const auto& step = *static_cast<const ShownStep*>(host);
        const rc_offset_fn own = step.given_.interpolate_rate;
        own ? step.call(own, "interpolate_rate", s, dxdt, n)
            : step.cubic_.interpolate_rate(s, {dxdt, n});
    }
    static void restep(const void* host, double s, double* x, std::size_t n)
    {
        const auto& step = *static_cast<const ShownStep*>(host);
        step.call(step.given_.restep, "restep", s, x, n);
    }

    const rc_host_step given_;
    double sign_;  ///< of the host's time
    HermiteStep cubic_;
};

}  // namespace ricochet::c
