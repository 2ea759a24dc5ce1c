// A gate that clears every state, and a body whose impacts take all of its speed.
#pragma once

#include <array>
#include <cmath>

#include "ricochet/gates.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::test {

/// Clears so long [s] in every state of two components up to 100.
[[nodiscard]] inline gates::Gate clearing_gate(double horizon)
{
    Model model;
    model.kind = "gate-horizon";
    model.recipe = "state";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.domain = {{-100, 100}, {-100, 100}};
    model.step_max = 1;
    model.layers = {{2, 2, {0, 0, 0, 0}, {0, 0}}, {2, 1, {0, 0}, {0}}};
    model.levels = {{.value = horizon, .threshold = 1}};
    return gates::Gate(model);
}

/// A shaken body on a spring beside a wall, where an impact takes all of its speed: it leaves the
/// wall with the rate zero, on the side to which it is accelerated.
struct PlasticOscillator {
    using State = std::array<double, 2>;
    void flow(double t, const State& x, State& dxdt) const
    {
        dxdt = {x[1], -0.7 * std::cos(2.7 * t) - x[0]};
    }
    [[nodiscard]] double guard(double, const State& x) const { return x[0] - 0.5; }
    void reset(double, State& x) const { x[1] = 0; }
    [[nodiscard]] double speed_bound(double, const State& x) const { return std::fabs(x[1]); }
    [[nodiscard]] double acceleration_bound(double, const State&) const { return 20; }
};

}  // namespace ricochet::test
