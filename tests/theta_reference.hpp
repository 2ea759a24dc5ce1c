// The ageing law along a history, integrated in its theta form in long double.
#pragma once

#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <vector>

#include "ricochet/faults/friction.hpp"

namespace ricochet::test {

/// Friction from theta' = 1 - V theta / D_RS by Fehlberg's method of order 8 in steps of
/// 1/1000 of an interval of 0.02 s: V h / D_RS <= 0.02, whose eighth power is 3e-14, times
/// an error constant of 1e-5.
inline std::vector<double> theta_friction(const RateStateParameters& p, const FrictionHistory& h)
{
    using Real = long double;
    boost::numeric::odeint::runge_kutta_fehlberg78<Real, Real, Real, Real,
                                                   boost::numeric::odeint::vector_space_algebra>
        stepper;
    const Real l = p.d_rs;
    Real theta = l / p.v_star;
    std::vector<double> out;
    constexpr int steps = 1000;
    for (std::size_t n = 0; n < h.t.size(); ++n) {
        if (n > 0) {
            const Real from = h.v[n - 1];
            const Real to = h.between == FrictionHistory::Between::linear ? h.v[n] : h.v[n - 1];
            const Real length = Real(h.t[n]) - h.t[n - 1];
            const auto flow = [&](const Real& x, Real& rate, Real t) {
                rate = 1 - (from + (to - from) * (t / length)) * x / l;
            };
            for (int i = 0; i < steps; ++i) {
                stepper.do_step(flow, theta, length * i / steps, length / steps);
            }
        }
        out.push_back(static_cast<double>(p.f_star + p.a * std::log(Real(h.v[n]) / p.v_star) +
                                          p.b * std::log(p.v_star * theta / l)));
    }
    return out;
}

}  // namespace ricochet::test
