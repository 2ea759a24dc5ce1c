// A system of your own: a damped pendulum that strikes a wall at the vertical.
//
// It declares only a flow, a guard and a reset. The rate of the guard is then computed along the
// flow, and the state type is that of the start of the run.

#include <array>
#include <cmath>
#include <cstdio>

#include "ricochet/ricochet.hpp"

struct StrikingPendulum {
    double length = 1.0;       // [m]
    double damping = 0.05;     // [1/s]
    double restitution = 0.7;  // Newton's coefficient

    static constexpr bool unilateral = true;  // the wall cannot be passed

    // x = (angle [rad], angular velocity [rad/s])
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.81 / length * std::sin(x[0]) - damping * x[1];
    }

    template <class X>
    double guard(double, const X& x) const
    {
        return x[0];
    }

    template <class X>
    void reset(double, X& x) const
    {
        x[0] = 0;
        x[1] *= -restitution;
    }
};

int main()
{
    const auto run = ricochet::integrate(StrikingPendulum{}, std::array{1.0, 0.0},
                                         {.t_end = 5, .rtol = 1e-10, .atol = 1e-12});
    for (const auto& strike : run.events) {
        std::printf("strike at %.9f s with %.6f rad/s\n", strike.t, -strike.before[1]);
    }
    std::printf("%s at %.3f s after %llu steps\n", ricochet::name(run.outcome).data(), run.t,
                static_cast<unsigned long long>(run.statistics.steps));
    return run.outcome == ricochet::Outcome::reached_end && run.events.size() >= 3 ? 0 : 1;
}
