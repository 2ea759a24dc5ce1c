// Additive pairs for tests.
#pragma once

#include "ricochet/faults/friction.hpp"

namespace ricochet::test {

/// The ageing law as a learned pair: A, C and G linear, xi = log(V* theta / D_RS) b / beta.
[[nodiscard]] inline AdditivePair::Parameters linear_nets()
{
    const RateStateParameters p;
    const double beta = 0.01;
    return {.v_star = p.v_star,
            .beta = beta,
            .direct = {.offset = p.f_star, .slope = p.a},
            .state = {.slope = beta / p.b},
            .rate = {.slope = p.b / beta * p.v_star / p.d_rs}};
}

/// The same with nonlinear units in the nets.
[[nodiscard]] inline AdditivePair::Parameters crooked_nets()
{
    AdditivePair::Parameters p = linear_nets();
    const auto bend = [](MonotoneNet& net, double size) {
        net.units = 3;
        net.weight = {size, 0.5 * size, -0.3 * size};
        net.scale = {0.4, 1.1, -0.7};
        net.shift = {-0.5, 1, 0.2};
    };
    bend(p.direct, 0.01);
    bend(p.state, 0.4);
    bend(p.rate, 40);
    return p;
}

}  // namespace ricochet::test
