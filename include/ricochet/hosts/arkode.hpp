// The Runge-Kutta methods of SUNDIALS as hosts, see `hosts::Cvode`: ERKStep, explicit; ARKStep,
// explicit, implicit or additive.
//
// Their dense output has an order of its own, below that of most methods, which limits the
// precision with which events are located.
#pragma once

#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>

#include "ricochet/hosts/detail/sundials.hpp"

namespace ricochet::hosts {

namespace detail {

struct ErkCalls {
    static constexpr const char* name = "ERKStep";
    void* memory;
    ARKRhsFn flow;
    void* data;

    int evolve(double t_stop, double& t, N_Vector x) const
    {
        return ERKStepEvolve(memory, t_stop, x, &t, ARK_ONE_STEP);
    }
    int set_stop(double t) const { return ERKStepSetStopTime(memory, t); }
    int dky(double t, int k, N_Vector x) const { return ERKStepGetDky(memory, t, k, x); }
    int reinit(double t, N_Vector x) const { return ERKStepReInit(memory, flow, t, x); }
    int rate(double t, N_Vector x, N_Vector dxdt) const
    {
        return -std::abs(flow(t, x, dxdt, data));
    }
};

struct ArkCalls {
    static constexpr const char* name = "ARKStep";
    void* memory;
    ARKRhsFn slow, fast;  ///< right-hand sides: `slow` explicit, `fast` implicit; one may be null
    void* data;

    int evolve(double t_stop, double& t, N_Vector x) const
    {
        return ARKStepEvolve(memory, t_stop, x, &t, ARK_ONE_STEP);
    }
    int set_stop(double t) const { return ARKStepSetStopTime(memory, t); }
    int dky(double t, int k, N_Vector x) const { return ARKStepGetDky(memory, t, k, x); }
    int reinit(double t, N_Vector x) const { return ARKStepReInit(memory, slow, fast, t, x); }
    int rate(double t, N_Vector x, N_Vector dxdt) const
    {
        const int flag = (slow ? slow : fast)(t, x, dxdt, data);
        if (flag != 0 || !slow || !fast) return -std::abs(flag);
        const N_Vector other = N_VClone(x);
        const int second = fast(t, x, other, data);
        N_VLinearSum(1, dxdt, 1, other, dxdt);
        N_VDestroy(other);
        return -std::abs(second);
    }
};

}  // namespace detail

/// A host for an integrator of ERKStep, which it does not own.
class ErkStep : public detail::SundialsHost<detail::ErkCalls> {
public:
    /// Attaches to an initialised integrator of ERKStep, and does not own it.
    ErkStep(void* erk, ARKRhsFn flow, void* data, double t, N_Vector x, double scale = 1e-3)
        : SundialsHost({erk, flow, data}, t, x, scale)
    {
    }
};

/// A host for an integrator of ARKStep, which it does not own.
class ArkStep : public detail::SundialsHost<detail::ArkCalls> {
public:
    /// Attaches to an initialised integrator of ARKStep, and does not own it.
    ArkStep(void* ark, ARKRhsFn slow, ARKRhsFn fast, void* data, double t, N_Vector x,
            double scale = 1e-3)
        : SundialsHost({ark, slow, fast, data}, t, x, scale)
    {
    }
};

}  // namespace ricochet::hosts
