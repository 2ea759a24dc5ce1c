// A smooth, nonlinear-in-time test system with events and a closed-form solution:
// the oscillator x'' = -x between impacts on a wall at x = -1/2.
#pragma once

#include <array>
#include <cmath>
#include <vector>

namespace ricochet::test {

/// State (x, v). Guard x + 1/2, falling; reset v+ = -e v-.
struct WalledOscillator {
    using State = std::array<double, 2>;

    double restitution = 0.8;
    static constexpr double wall = -0.5;
    static constexpr bool unilateral = true;

    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        return x[0] - wall;
    }
    template <class X>
    [[nodiscard]] double guard_rate(double, const X&, const X& dxdt) const
    {
        return dxdt[0];
    }
    template <class X>
    void reset(double, X& x) const
    {
        x[0] = wall;
        x[1] *= -restitution;
    }

    /// Impact times from x = 1 at rest. With amplitude a the wall is met at the phase
    /// acos(wall / a), and left at minus that phase.
    [[nodiscard]] std::vector<double> impacts(double t_end) const
    {
        std::vector<double> times;
        double t = std::acos(wall);
        double speed = std::sqrt(1 - wall * wall);
        while (t <= t_end) {
            times.push_back(t);
            speed *= restitution;
            const double amplitude = std::hypot(wall, speed);
            t += 2 * std::acos(wall / amplitude);
        }
        return times;
    }
};

}  // namespace ricochet::test
