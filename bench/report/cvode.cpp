// SUNDIALS CVODE with its own root finding, as its manual recommends: Adams with a fixed-point
// iteration, since none of these problems is stiff; directions of the roots set; CVodeReInit after
// a reset. Setting up the memory, once, is not timed.
#include <cvode/cvode.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <memory>

#include "hosts/sundials_setup.hpp"
#include "ricochet/monitor.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "sundials.hpp"

namespace ricochet::report {

namespace {

template <class S>
class Solver {
public:
    Solver(Task<S> task, double tolerance)
        : task_(std::move(task)), system_(task_.system), state_(task_.x0.size())
    {
        memory_ = CVodeCreate(CV_ADAMS, state_.context);
        iteration_ = SUNNonlinSol_FixedPoint(state_.x, 0, state_.context);
        require(CVodeInit(memory_, flow_of<S>, 0, state_.x), "CVodeInit");
        require(CVodeSStolerances(memory_, tolerance, tolerance), "CVodeSStolerances");
        require(CVodeSetUserData(memory_, &system_), "CVodeSetUserData");
        require(CVodeSetNonlinearSolver(memory_, iteration_), "CVodeSetNonlinearSolver");
        require(CVodeSetMaxNumSteps(memory_, 1000000), "CVodeSetMaxNumSteps");
        require(CVodeSetErrHandlerFn(
                    memory_, [](int, const char*, const char*, char*, void*) {}, nullptr),
                "CVodeSetErrHandlerFn");
        const std::size_t guards = system_.guards();
        if (guards > 0) {
            require(CVodeRootInit(memory_, static_cast<int>(guards), guards_of<S>),
                    "CVodeRootInit");
            std::vector<int> directions(guards, Seen<S>::direction());
            require(CVodeSetRootDirection(memory_, directions.data()), "CVodeSetRootDirection");
            require(CVodeSetNoInactiveRootWarn(memory_), "CVodeSetNoInactiveRootWarn");
        }
    }
    Solver(const Solver&) = delete;
    Solver& operator=(const Solver&) = delete;
    ~Solver()
    {
        CVodeFree(&memory_);
        SUNNonlinSolFree(iteration_);
    }

    bool run(Answer& answer, std::size_t offset)
    {
        return drive(
            system_, task_, state_.x, answer, offset, CV_ROOT_RETURN,
            [&](double t_end, double* t) { return CVode(memory_, t_end, state_.x, t, CV_NORMAL); },
            [&](int* flags) { CVodeGetRootInfo(memory_, flags); },
            [&](double t) { require(CVodeReInit(memory_, t, state_.x), "CVodeReInit"); });
    }

private:
    Task<S> task_;
    Seen<S> system_;
    State state_;
    void* memory_ = nullptr;
    SUNNonlinearSolver iteration_ = nullptr;
};

/// The ball in the same integrator, whose steps the monitor examines instead.
Answer ball_by_monitor(double tolerance)
{
    const BouncingBall system({.gravity = 9.81, .restitution = 0.9});
    const Mode mode = 0;
    const BouncingBall::State x0{10, 0};
    hosts_test::CvodeOf<BouncingBall, CV_ADAMS> made(system, mode, x0, {tolerance, tolerance});
    EventMonitor monitor(system, x0, {.event_states = false});
    Answer answer{.finished = hosts::run(made.host(), monitor, 20.5) == Verdict::stands};
    for (const auto& event : monitor.events()) answer.add(event.t, event.guard);
    return answer;
}

}  // namespace

void add_cvode(Cells& cells)
{
    cells.add_version("CVODE", sundials_version());
    add_solver_cells<Solver>(cells, "CVODE", "Adams, root finding");
    for (const double tolerance : tolerances_of("ball")) {
        cells.add({"ball", "ricochet", "monitor in CVODE, Adams", tolerance,
                   [=] { return [=] { return ball_by_monitor(tolerance); }; }});
    }
}

}  // namespace ricochet::report
