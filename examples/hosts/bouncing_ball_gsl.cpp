// The bouncing ball by a method of order 8 of GSL.
#include <array>
#include <cstdio>
#include <ricochet/hosts/gsl.hpp>
#include <ricochet/systems/bouncing_ball.hpp>

namespace {

int flow(double t, const double x[], double dxdt[], void* ball)
{
    const std::array<double, 2> at{x[0], x[1]};
    std::array<double, 2> rate{};
    static_cast<const ricochet::BouncingBall*>(ball)->flow(t, at, rate);
    dxdt[0] = rate[0];
    dxdt[1] = rate[1];
    return GSL_SUCCESS;
}

}  // namespace

int main()
{
    ricochet::BouncingBall ball;
    gsl_odeiv2_system system{flow, nullptr, 2, &ball};
    gsl_odeiv2_driver* driver =
        gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, 1e-3, 1e-13, 1e-10);

    const ricochet::BouncingBall::State x0{10, 0};
    ricochet::hosts::Gsl host(*driver, 0, x0);
    ricochet::EventMonitor monitor(ball, x0);
    ricochet::hosts::run(host, monitor, 20.5);
    for (const auto& impact : monitor.events()) std::printf("%.12f s\n", impact.t);

    gsl_odeiv2_driver_free(driver);
    return monitor.events().size() == 13 ? 0 : 1;
}
