// Systems whose functions are templates over their scalar, for measurements of Taylor's method.
#pragma once

#include <array>
#include <cmath>

namespace ricochet::bench {

using Two = std::array<double, 2>;
using Four = std::array<double, 4>;

/// As `ImpactOscillator` with a frequency of 0.8 and a restitution of 0.8.
struct Impact {
    using State = Two;
    static constexpr bool unilateral = true;
    double wall = 1;

    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cos;
        dxdt[0] = x[1];
        dxdt[1] = cos(0.8 * t) - x[0] - 0.1 * x[1];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return wall - x[0];
    }
    [[nodiscard]] double guard_rate(double /*t*/, const State& /*x*/, const State& dxdt) const
    {
        return -dxdt[0];
    }
    void reset(double /*t*/, State& x) const
    {
        x[0] = wall;
        x[1] *= -0.8;
    }
};

struct Pendulum {
    using State = Two;
    static constexpr Two start{2, 0};
    static constexpr double t_end = 1000;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -sin(x[0]);
    }
};

struct HenonHeiles {
    using State = Four;
    static constexpr Four start{0, 0.1, 0.4, 0.05};
    static constexpr double t_end = 1000;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -x[0] - 2.0 * x[0] * x[1];
        dxdt[3] = x[1] * x[1] - x[1] - x[0] * x[0];
    }
};

}  // namespace ricochet::bench
