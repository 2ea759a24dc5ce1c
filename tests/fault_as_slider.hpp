// A fault of one element and the equivalent slider: K = 1, hence mass rho L, stiffness G / L,
// normal force sigma.
#pragma once

#include <limits>

#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::test {

struct FaultAsSlider {
    static constexpr double t_end = 30;  ///< [s]
    static constexpr double step = 0.1;  ///< [s]

    StrikeSlipFault fault{{.elements = 1, .damping = 0}};
    FaultFriction friction{.plate_velocity = 2e-3, .slip_rate = 1e-3, .overload = 1e-3};

    [[nodiscard]] RateStateRupture run_fault(int order) const
    {
        return simulate(
            fault, {.t_end = t_end, .step = step, .rtol = std::numeric_limits<double>::infinity()},
            friction, {.order = order});
    }

    [[nodiscard]] SliderRun run_as_slider(int order) const
    {
        const auto& p = fault.parameters();
        const double sigma = p.stress_gradient * p.side / 2;
        const double stiffness = p.shear_modulus / p.side;
        const AgeingLaw<> law(friction.law);
        const double v = friction.slip_rate;
        const double xi = law.steady_state(v);
        const double draw = (1 + friction.overload) * sigma * law.friction(v, xi) / stiffness;
        const SpringSlider slider{
            .friction = friction.law,
            .block = {.mass = p.density * p.side, .stiffness = stiffness, .normal_force = sigma},
            .load = SliderLoad(draw, friction.plate_velocity)};
        return run_slider(slider, {0, 0, v, xi}, {.t_end = t_end, .order = order, .step = step});
    }
};

}  // namespace ricochet::test
