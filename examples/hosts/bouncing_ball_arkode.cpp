// The bouncing ball by an explicit Runge-Kutta method of ARKODE.
#include <nvector/nvector_serial.h>

#include <cstdio>
#include <ricochet/hosts/arkode.hpp>
#include <ricochet/systems/bouncing_ball.hpp>

namespace {

int flow(double t, N_Vector x, N_Vector dxdt, void* ball)
{
    double* rate = N_VGetArrayPointer(dxdt);
    static_cast<const ricochet::BouncingBall*>(ball)->flow(t, N_VGetArrayPointer(x), rate);
    return 0;
}

}  // namespace

int main()
{
    ricochet::BouncingBall ball;
    SUNContext context = nullptr;
    SUNContext_Create(nullptr, &context);
    N_Vector x = N_VNew_Serial(2, context);
    N_VGetArrayPointer(x)[0] = 10;
    N_VGetArrayPointer(x)[1] = 0;
    void* erk = ERKStepCreate(flow, 0, x, context);
    ERKStepSStolerances(erk, 1e-10, 1e-13);
    ERKStepSetUserData(erk, &ball);

    ricochet::hosts::ErkStep host(erk, flow, &ball, 0, x);
    ricochet::EventMonitor monitor(ball, ricochet::BouncingBall::State{});
    ricochet::hosts::run(host, monitor, 20.5);
    for (const auto& impact : monitor.events()) std::printf("%.12f s\n", impact.t);

    ERKStepFree(&erk);
    N_VDestroy(x);
    SUNContext_Free(&context);
    return monitor.events().size() == 13 ? 0 : 1;
}
