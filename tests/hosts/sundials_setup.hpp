// Integrators of SUNDIALS set up for the tests, and freed.
#pragma once

#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <memory>

#include "hosts/host_systems.hpp"
#include "ricochet/hosts/cvode.hpp"

namespace ricochet::hosts_test {

template <class System>
int sundials_flow(double t, N_Vector x, N_Vector dxdt, void* flow)
{
    (*static_cast<const FlowOf<System>*>(flow))(t, N_VGetArrayPointer(x), N_VGetArrayPointer(dxdt),
                                                static_cast<std::size_t>(N_VGetLength(x)));
    return 0;
}

/// The context, the state at the start, and the solvers of one integrator.
class SundialsParts {
public:
    template <class X>
    explicit SundialsParts(const X& start)
    {
        SUNContext_Create(nullptr, &context);
        x = N_VNew_Serial(static_cast<sunindextype>(start.size()), context);
        std::ranges::copy(start, N_VGetArrayPointer(x));
    }
    SundialsParts(const SundialsParts&) = delete;
    SundialsParts& operator=(const SundialsParts&) = delete;
    ~SundialsParts()
    {
        if (fixed_point) SUNNonlinSolFree(fixed_point);
        if (dense) SUNLinSolFree(dense);
        if (matrix) SUNMatDestroy(matrix);
        N_VDestroy(x);
        SUNContext_Free(&context);
    }

    void make_fixed_point() { fixed_point = SUNNonlinSol_FixedPoint(x, 0, context); }
    void make_dense()
    {
        const sunindextype n = N_VGetLength(x);
        matrix = SUNDenseMatrix(n, n, context);
        dense = SUNLinSol_Dense(x, matrix, context);
    }

    SUNContext context = nullptr;
    N_Vector x = nullptr;
    SUNNonlinearSolver fixed_point = nullptr;
    SUNMatrix matrix = nullptr;
    SUNLinearSolver dense = nullptr;
};

/// CVODE by `method`, CV_ADAMS or CV_BDF.
template <class System, int method>
class CvodeOf {
public:
    CvodeOf(const System& system, const Mode& mode, const typename System::State& x0,
            const Tolerances& tolerances)
        : parts_(x0), flow_{&system, &mode}, memory_(CVodeCreate(method, parts_.context))
    {
        CVodeInit(memory_, sundials_flow<System>, 0, parts_.x);
        CVodeSStolerances(memory_, tolerances.rtol, tolerances.atol);
        CVodeSetUserData(memory_, &flow_);
        CVodeSetMaxNumSteps(memory_, 100000);
        if (method == CV_ADAMS) {
            parts_.make_fixed_point();
            CVodeSetNonlinearSolver(memory_, parts_.fixed_point);
        } else {
            parts_.make_dense();
            CVodeSetLinearSolver(memory_, parts_.dense, parts_.matrix);
        }
        host_ = std::make_unique<hosts::Cvode>(memory_, sundials_flow<System>, &flow_, 0, parts_.x);
    }
    CvodeOf(const CvodeOf&) = delete;
    CvodeOf& operator=(const CvodeOf&) = delete;
    ~CvodeOf() { CVodeFree(&memory_); }

    [[nodiscard]] hosts::Cvode& host() noexcept { return *host_; }
    [[nodiscard]] void* memory() noexcept { return memory_; }

private:
    SundialsParts parts_;
    FlowOf<System> flow_;
    void* memory_;
    std::unique_ptr<hosts::Cvode> host_;
};

}  // namespace ricochet::hosts_test
