// CVODE of SUNDIALS as a host: its steps are shown one by one, events are located on its dense
// output, and it is initialised again where an event changes the state or the mode.
//
//     void* cvode = CVodeCreate(CV_BDF, context);
//     CVodeInit(cvode, flow, t, x);                       // and tolerances, a linear solver, ...
//     hosts::Cvode host(cvode, flow, data, t, x);
//     EventMonitor monitor(system, start);
//     hosts::run(host, monitor, t_end);
#pragma once

#include <cvode/cvode.h>

#include "ricochet/hosts/detail/sundials.hpp"

namespace ricochet::hosts {

namespace detail {

struct CvodeCalls {
    static constexpr const char* name = "CVODE";
    void* memory;
    CVRhsFn flow;
    void* data;

    int evolve(double t_stop, double& t, N_Vector x) const
    {
        return CVode(memory, t_stop, x, &t, CV_ONE_STEP);
    }
    int set_stop(double t) const { return CVodeSetStopTime(memory, t); }
    int dky(double t, int k, N_Vector x) const { return CVodeGetDky(memory, t, k, x); }
    [[nodiscard]] int order() const
    {
        int order = 0;
        CVodeGetLastOrder(memory, &order);
        return order;
    }
    int reinit(double t, N_Vector x) const { return CVodeReInit(memory, t, x); }
    int rate(double t, N_Vector x, N_Vector dxdt) const
    {
        return -std::abs(flow(t, x, dxdt, data));
    }
};

}  // namespace detail

/// A host for an integrator of CVODE, which it does not own and which is set up except for time and
/// state.
class Cvode : public detail::SundialsHost<detail::CvodeCalls> {
public:
    /// @param flow, data  those of the integrator
    Cvode(void* cvode, CVRhsFn flow, void* data, double t, N_Vector x, double scale = 1e-3)
        : SundialsHost({cvode, flow, data}, t, x, scale)
    {
    }
};

}  // namespace ricochet::hosts
