// A mass on a belt, sticking and slipping, by CVODE: two modes, whose flow CVODE's callback takes
// from the monitor.
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <array>
#include <cstdio>
#include <ricochet/hosts/cvode.hpp>

namespace {

struct StickSlip {
    using State = std::array<double, 2>;  ///< position [m], velocity [m/s]
    enum : ricochet::Mode { sticks, slips };
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 2;

    template <class X>
    void flow(ricochet::Mode mode, double /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = mode == sticks ? 0 : 0.5 - x[0];
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, ricochet::Mode /*mode*/, double /*t*/,
                               const X& x) const
    {
        return which == sticks ? 1 - x[0] : 0.2 - x[1];
    }
    [[nodiscard]] bool enabled(std::size_t which, ricochet::Mode mode) const
    {
        return which == mode;
    }
    [[nodiscard]] ricochet::Mode reset(std::size_t which, ricochet::Mode /*mode*/, double /*t*/,
                                       State& x) const
    {
        x[1] = 0.2;
        return which == sticks ? slips : sticks;
    }
};

/// Data that CVODE passes to the flow.
struct Motion {
    StickSlip system;
    ricochet::Mode mode = StickSlip::sticks;

    static int flow(double t, N_Vector x, N_Vector dxdt, void* self)
    {
        const auto& motion = *static_cast<const Motion*>(self);
        double* rate = N_VGetArrayPointer(dxdt);
        motion.system.flow(motion.mode, t, N_VGetArrayPointer(x), rate);
        return 0;
    }
};

}  // namespace

int main()
{
    Motion motion;
    SUNContext context = nullptr;
    SUNContext_Create(nullptr, &context);
    N_Vector x = N_VNew_Serial(2, context);
    N_VGetArrayPointer(x)[0] = 0;
    N_VGetArrayPointer(x)[1] = 0.2;
    void* cvode = CVodeCreate(CV_ADAMS, context);
    SUNNonlinearSolver solver = SUNNonlinSol_FixedPoint(x, 0, context);
    CVodeInit(cvode, Motion::flow, 0, x);
    CVodeSStolerances(cvode, 1e-9, 1e-12);
    CVodeSetUserData(cvode, &motion);
    CVodeSetNonlinearSolver(cvode, solver);

    ricochet::hosts::Cvode host(cvode, Motion::flow, &motion, 0, x);
    ricochet::EventMonitor monitor(motion.system, StickSlip::State{});
    ricochet::hosts::run(host, monitor, 40, [&](const auto& cut) {
        motion.mode = cut.mode_after;
        std::printf("%.9f s at %+.6f m: %s\n", cut.t.value, cut.after[0],
                    motion.mode == StickSlip::slips ? "slips" : "sticks");
    });
    const bool found = monitor.events().size() == 8;

    CVodeFree(&cvode);
    SUNNonlinSolFree(solver);
    N_VDestroy(x);
    SUNContext_Free(&context);
    return found ? 0 : 1;
}
