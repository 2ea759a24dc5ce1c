// A buck converter by CVODE's BDF: a switch at known times, a diode by its voltage, and a node
// between them that reacts a million times faster than the switch.
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <ricochet/hosts/cvode.hpp>

namespace {

using ricochet::Mode;

struct BuckConverter {
    using State = std::array<double, 3>;  ///< current [A], output [V], node [V]
    enum : Mode { switched_on = 1, conducts = 2 };
    static constexpr std::size_t mode_count = 4;
    static constexpr std::size_t guard_count = 2;
    static constexpr double half_period = 5e-5;  ///< [s]

    template <class X>
    void flow(Mode mode, double /*t*/, const X& x, X& dxdt) const
    {
        const double from_switch = mode & switched_on ? (24 - x[2]) / 0.1 : 0;
        const double from_diode = mode & conducts ? -x[2] / 0.1 : 0;
        dxdt[0] = (x[2] - x[1]) / 5e-4;
        dxdt[1] = (x[0] - x[1] / 5) / 1e-4;
        dxdt[2] = (from_switch + from_diode - x[0] - x[2] / 1e5) / 1e-9;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, Mode /*mode*/, double /*t*/, const X& x) const
    {
        return which == 0 ? x[2] : -x[2];
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return (which == 1) == ((mode & conducts) != 0);
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double /*t*/, State& /*x*/) const
    {
        return which == 0 ? mode | conducts : mode & ~Mode{conducts};
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return (std::floor(t / half_period + 1e-6) + 1) * half_period;
    }
    [[nodiscard]] Mode time_reset(Mode mode, double /*t*/, State& /*x*/) const
    {
        return mode ^ switched_on;
    }
};

struct Circuit {
    BuckConverter system;
    Mode mode = BuckConverter::switched_on;

    static int flow(double t, N_Vector x, N_Vector dxdt, void* self)
    {
        const auto& circuit = *static_cast<const Circuit*>(self);
        double* rate = N_VGetArrayPointer(dxdt);
        circuit.system.flow(circuit.mode, t, N_VGetArrayPointer(x), rate);
        return 0;
    }
};

}  // namespace

int main()
{
    Circuit circuit;
    SUNContext context = nullptr;
    SUNContext_Create(nullptr, &context);
    N_Vector x = N_VNew_Serial(3, context);
    N_VConst(0, x);
    void* cvode = CVodeCreate(CV_BDF, context);
    SUNMatrix matrix = SUNDenseMatrix(3, 3, context);
    SUNLinearSolver solver = SUNLinSol_Dense(x, matrix, context);
    CVodeInit(cvode, Circuit::flow, 0, x);
    CVodeSStolerances(cvode, 1e-6, 1e-5);
    CVodeSetUserData(cvode, &circuit);
    CVodeSetLinearSolver(cvode, solver, matrix);

    ricochet::hosts::Cvode host(cvode, Circuit::flow, &circuit, 0, x, 1e-9);
    ricochet::EventMonitor monitor(circuit.system, BuckConverter::State{});
    int cuts = 0;
    ricochet::hosts::run(
        host, monitor, 50 * BuckConverter::half_period,
        [&](const auto& cut) {
            circuit.mode = cut.mode_after;
            ++cuts;
        },
        circuit.mode);
    std::printf("%d changes of the circuit, output %.3f V\n", cuts, host.x()[1]);
    const bool plausible = std::fabs(host.x()[1] - 12) < 3;

    CVodeFree(&cvode);
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    N_VDestroy(x);
    SUNContext_Free(&context);
    return plausible ? 0 : 1;
}
