// The spring-slider with rate-and-state friction as a hybrid system, for the event loop.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/hybrid/guard.hpp"

namespace ricochet {

/// A block on a spring with the ageing law, in the logarithm of its slip rate, V > 0.
///
/// State (x / D_RS, log(V / V*), xi), one guard, corners of the load as time events.
///
///     flow    x' = V,  m V' = k (x_p(t) - x) - N f(V, xi),  xi' = (V* e^-xi - V) / D_RS
///     guard   log(V / threshold), either way: onset rising, arrest falling; nothing happens
///
/// Explicit steps are bounded by m V / (N a), which in stick-slip falls below a
/// microsecond: `run_slider` takes the steps that accuracy asks for. Functions are generic in
/// the state type.
class RateStateSlider {
public:
    using State = std::array<double, 3>;

    /// @throws std::invalid_argument if a parameter is outside its range, or the threshold
    /// [m/s] is not positive.
    RateStateSlider(const SpringSlider& slider, double threshold);

    static constexpr std::string_view name = "rate-state-slider";
    /// Start state of the event-driven run that corresponds to `at`.
    [[nodiscard]] State start(const SliderState& at) const;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "threshold", .crossing = Crossing::either, .degree = 1};
    }

    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        const RateStateParameters& p = slider_.friction;
        const double v = p.v_star * std::exp(x[1]);
        const double friction = p.f_star + p.a * x[1] + p.b * x[2];
        const double pull = slider_.block.stiffness * (slider_.load(t) - p.d_rs * x[0]);
        dxdt[0] = v / p.d_rs;
        dxdt[1] = (pull - slider_.block.normal_force * friction) / (slider_.block.mass * v);
        dxdt[2] = (p.v_star * std::exp(-x[2]) - v) / p.d_rs;
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return x[1] - level_;
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const noexcept
    {
        return dxdt[1];
    }

    [[nodiscard]] double next_time_event(double t) const noexcept
    {
        return slider_.load.next_corner(t);
    }

private:
    SpringSlider slider_;
    double level_;  ///< log(threshold / V*)
};

}  // namespace ricochet
