// A strike-slip fault with rate-and-state friction that is driven by plates at a millimetre a
// second. Slip of all elements is compared at 101 times.
//
// Methods for any system and CVODE's BDF take the same equations, in the logarithms of the slip
// rates, by the same functions.
#include <algorithm>
#include <memory>
#include <span>

#include "cells.hpp"
#include "ricochet/faults/fault_system.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/rosenbrock.hpp"
#ifdef RICOCHET_REPORT_CVODE
#include <cvode/cvode.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "sundials.hpp"
#endif

namespace ricochet::report {

namespace {

constexpr double fault_end = 30;  ///< [s]
constexpr std::size_t fault_intervals = 100;

[[nodiscard]] double fault_time(std::size_t k)
{
    return fault_end * static_cast<double>(k) / static_cast<double>(fault_intervals);
}

[[nodiscard]] StrikeSlipFault fault()
{
    return StrikeSlipFault({.elements = 3});
}

[[nodiscard]] FaultFriction fault_friction()
{
    return {.plate_velocity = 1e-3, .slip_rate = 2e-3, .overload = 1e-3};
}

[[nodiscard]] Answer by_variational_steps(const StrikeSlipFault& fault, int order, double tolerance)
{
    RuptureOptions options{
        .t_end = fault_end, .rtol = tolerance, .polynomial_bound = std::min(1e-4, tolerance)};
    for (std::size_t k = 0; k <= fault_intervals; ++k) {
        options.snapshot_times.push_back(fault_time(k));
    }
    const RateStateRupture run =
        simulate(fault, options, fault_friction(),
                 {.order = order, .tolerance = std::clamp(1e-3 * tolerance, 1e-13, 1e-11)});
    Answer answer{.finished = run.rupture.outcome == Outcome::reached_end,
                  .steps = run.rupture.statistics.steps};
    for (const RuptureSnapshot& at : run.rupture.snapshots) {
        answer.samples.emplace_back(at.slip.begin(), at.slip.end());
    }
    if (!answer.finished) answer.note = describe(run.rupture.outcome);
    return answer;
}

[[nodiscard]] std::vector<double> slips(const RateStateFaultSystem& system, double t,
                                        std::span<const double> x)
{
    const Eigen::VectorXd slip = system.slip(t, x);
    return {slip.begin(), slip.end()};
}

template <class Method>
[[nodiscard]] Answer by_event_loop(const RateStateFaultSystem& system, double tolerance)
{
    Options options{.t_end = fault_end, .rtol = tolerance, .atol = tolerance};
    for (std::size_t k = 0; k <= fault_intervals; ++k) {
        options.sample_times.push_back(fault_time(k));
    }
    const auto run = integrate(system, system.start(), options, ErrorControlled<Method>{});
    Answer answer{.finished = run.outcome == Outcome::reached_end,
                  .steps = run.statistics.steps,
                  .flow_calls = run.statistics.flow_calls};
    for (std::size_t k = 0; k < run.trajectory.t.size(); ++k) {
        answer.samples.push_back(slips(system, run.trajectory.t[k], run.trajectory.x[k]));
    }
    if (!answer.finished) answer.note = describe(run.outcome);
    return answer;
}

#ifdef RICOCHET_REPORT_CVODE

/// What the callbacks are given.
struct CvodeFault {
    RateStateFaultSystem system{fault(), fault_friction()};
    std::vector<double> rows{};
};

[[nodiscard]] std::span<double> values(N_Vector x)
{
    return {NV_DATA_S(x), static_cast<std::size_t>(NV_LENGTH_S(x))};
}

int fault_flow(double t, N_Vector x, N_Vector dxdt, void* user)
{
    std::span<double> rate = values(dxdt);
    static_cast<CvodeFault*>(user)->system.flow(t, values(x), rate);
    return 0;
}

int fault_jacobian(double t, N_Vector x, N_Vector /*rate*/, SUNMatrix jacobian, void* user,
                   N_Vector /*a*/, N_Vector /*b*/, N_Vector /*c*/)
{
    auto& [system, rows] = *static_cast<CvodeFault*>(user);
    const std::size_t n = values(x).size();
    rows.resize(n * n);
    system.jacobian(t, values(x), rows);
    for (std::size_t j = 0; j < n; ++j) {
        double* const column = SM_COLUMN_D(jacobian, static_cast<sunindextype>(j));
        for (std::size_t i = 0; i < n; ++i) column[i] = rows[i * n + j];
    }
    return 0;
}

/// BDF with a dense Jacobian: the one that Rosenbrock4 has if it is `written`, else, as is CVODE's
/// default, by differences.
[[nodiscard]] Answer by_cvode(CvodeFault& fault, bool written, double tolerance)
{
    const RateStateFaultSystem::State x0 = fault.system.start();
    const State at(x0.size());
    std::ranges::copy(x0, NV_DATA_S(at.x));
    void* memory = CVodeCreate(CV_BDF, at.context);
    const SUNMatrix matrix = SUNDenseMatrix(NV_LENGTH_S(at.x), NV_LENGTH_S(at.x), at.context);
    const SUNLinearSolver solver = SUNLinSol_Dense(at.x, matrix, at.context);
    require(CVodeInit(memory, fault_flow, 0, at.x), "CVodeInit");
    require(CVodeSStolerances(memory, tolerance, tolerance), "CVodeSStolerances");
    require(CVodeSetUserData(memory, &fault), "CVodeSetUserData");
    require(CVodeSetMaxNumSteps(memory, 100000), "CVodeSetMaxNumSteps");
    require(CVodeSetLinearSolver(memory, solver, matrix), "CVodeSetLinearSolver");
    if (written) require(CVodeSetJacFn(memory, fault_jacobian), "CVodeSetJacFn");
    Answer answer{.finished = true};
    answer.samples.push_back(slips(fault.system, 0, x0));
    for (std::size_t k = 1; k <= fault_intervals && answer.finished; ++k) {
        double t = 0;
        const int flag = CVode(memory, fault_time(k), at.x, &t, CV_NORMAL);
        answer.samples.push_back(slips(fault.system, fault_time(k), values(at.x)));
        answer.finished = flag >= 0;
        if (flag < 0) answer.note = "error flag " + std::to_string(flag);
    }
    long steps = 0;
    CVodeGetNumSteps(memory, &steps);
    answer.steps = static_cast<std::uint64_t>(steps);
    CVodeFree(&memory);
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    return answer;
}

#endif

/// ricochet at a tolerance of 1e-12; with CVODE at 1e-12 it agrees to 6e-11.
[[nodiscard]] Reference fault_reference()
{
    Reference out{.problem = "fault",
                  .title = "Strike-slip fault of 3 x 3 elements, driven",
                  .t_end = fault_end,
                  .samples = by_variational_steps(fault(), 4, 1e-12).samples};
    for (std::size_t k = 0; k <= fault_intervals; ++k) out.sample_times.push_back(fault_time(k));
    return out;
}

template <class Solve>
void add_event_loop(Cells& cells, const std::string& how, double tolerance, Solve solve)
{
    cells.add({"fault", "ricochet", how, tolerance, [=] {
                   return [system = RateStateFaultSystem(fault(), fault_friction()), solve,
                           tolerance] { return solve(system, tolerance); };
               }});
}

}  // namespace

void add_fault(Cells& cells)
{
    cells.add_reference(fault_reference);
    for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-12}) {
        for (const int order : {2, 4}) {
            if (tolerance < (order == 2 ? 1e-8 : 1e-10)) continue;  // a run would take seconds
            cells.add({"fault", "ricochet", "variational, order " + std::to_string(order),
                       tolerance, [=] {
                           return [made = fault(), order, tolerance] {
                               return by_variational_steps(made, order, tolerance);
                           };
                       }});
        }
        add_event_loop(cells, "dopri5", tolerance, by_event_loop<Dopri5>);
        if (tolerance >= 1e-10) {
            add_event_loop(cells, "Rosenbrock4, Jacobian written", tolerance,
                           by_event_loop<Rosenbrock4>);
        }
#ifdef RICOCHET_REPORT_CVODE
        for (const bool written : {false, true}) {
            cells.add({"fault", "CVODE", written ? "BDF, Jacobian written" : "BDF", tolerance, [=] {
                           return [made = std::make_shared<CvodeFault>(), written, tolerance] {
                               return by_cvode(*made, written, tolerance);
                           };
                       }});
        }
#endif
    }
}

}  // namespace ricochet::report
