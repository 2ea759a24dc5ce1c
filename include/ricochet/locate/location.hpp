// When exactly? What locators are given and what they return.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "ricochet/detect/finding.hpp"
#include "ricochet/hybrid/components.hpp"

namespace ricochet {

/// Where the guard left its side, as offsets [s] from the start of the step.
struct Location {
    double lo = 0;                                            ///< still on the armed side
    double hi = 0;                                            ///< across the surface or on it
    double slope = std::numeric_limits<double>::quiet_NaN();  ///< rate of the guard at `hi`
    double error = 0;  ///< [s] width of the bracket, or more where rounding in g is coarser
};

/// The narrowest bracket worth having at offset s of a step of length h: neighbouring
/// doubles, or a millionth of their spacing at the end of the step.
[[nodiscard]] inline double finest_bracket(double s, double h) noexcept
{
    return std::numeric_limits<double>::epsilon() * std::max(std::fabs(s), 0x1p-20 * std::fabs(h));
}

/// The guard along the step's own map: every sample repeats the step from its
/// start with another length, so that an event is as accurate as the method. The
/// state of the last sample beyond the surface is kept for the event.
template <class Guard, class Step>
class StepProbe {
public:
    using State = typename Guard::State;

    StepProbe(const Guard& guard, const Step& step, Side side)
        : guard_(&guard),
          step_(&step),
          side_(side),
          x_(step.x0()),
          dxdt_(step.x0()),
          ahead_(step.x0()),
          beyond_(step.x1()),
          beyond_at_(step.h())
    {
    }

    [[nodiscard]] bool has_left(const GuardSample& sample) const noexcept
    {
        return ricochet::has_left(side_, sample.value);
    }

    /// The guard at offset s.
    [[nodiscard]] GuardSample value(double s)
    {
        if (on_dense_output_) {
            step_->interpolate(s, x_);
        } else {
            step_->restep(s, x_);
        }
        return keep({.s = s, .value = guard_->value(step_->time(s), x_)});
    }

    /// The guard and its rate at offset s; the slope comes from the flow.
    [[nodiscard]] GuardSample value_and_rate(double s)
    {
        if (on_dense_output_) {
            step_->interpolate(s, x_);
            step_->flow(s, x_, dxdt_);
        } else {
            step_->restep(s, x_, dxdt_);
        }
        const double t = step_->time(s);
        return keep({.s = s,
                     .value = guard_->value(t, x_),
                     .rate = guard_->rate(t, x_, dxdt_, step_->h())});
    }

    /// The guard at offset s on the straight line through `sample`, the last that
    /// `value_and_rate` took.
    [[nodiscard]] GuardSample along_the_flow(const GuardSample& sample, double s)
    {
        detail::move(ahead_, x_, s - sample.s, dxdt_);
        const GuardSample at{
            .s = s, .value = guard_->value(step_->time(s), ahead_), .rate = sample.rate};
        if (has_left(at)) {
            detail::assign(beyond_, ahead_);
            beyond_at_ = s;
        }
        return at;
    }

    [[nodiscard]] Side side() const noexcept { return side_; }

    /// The rate of the guard at a sample where it is not known yet: at the ends of
    /// the step from the rates there.
    void complete(GuardSample& sample) const
    {
        if (sample.rate == sample.rate) return;
        const bool at_start = sample.s == 0;
        const auto& x = at_start ? step_->x0() : step_->x1();
        const auto& dxdt = at_start ? step_->rate0() : step_->rate1();
        const double t = step_->time(sample.s);
        sample.rate = guard_->rate(t, x, dxdt, step_->h());
    }

    /// Detection looked at the dense output. Where the step's own map disagrees
    /// with it about the far end of the bracket, as it can near tangency, the dense
    /// output is used from here on.
    void agree_on(const GuardSample& hi)
    {
        if (hi.s == step_->h()) return;
        if (!has_left(value(hi.s))) {
            on_dense_output_ = true;
            (void)value(hi.s);
        }
    }

    /// The state at offset s, beyond the surface.
    [[nodiscard]] const State& state_beyond(double s)
    {
        if (s != beyond_at_) {
            (void)value(s);
            detail::assign(beyond_, x_);
        }
        return beyond_;
    }

    /// Narrowest useful bracket near offset s.
    [[nodiscard]] double finest(double s) const noexcept
    {
        return finest_bracket(s, step_->h());
    }

private:
    [[nodiscard]] GuardSample keep(const GuardSample& sample)
    {
        if (has_left(sample)) {
            detail::assign(beyond_, x_);
            beyond_at_ = sample.s;
        }
        return sample;
    }

    const Guard* guard_;
    const Step* step_;
    Side side_;
    State x_, dxdt_, ahead_, beyond_;
    double beyond_at_;
    bool on_dense_output_ = false;
};

}  // namespace ricochet
