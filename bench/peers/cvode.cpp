#include "peers/cvode.hpp"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace ricochet::bench {

namespace {

void require(int flag, const char* what)
{
    if (flag < 0) throw std::runtime_error("CVODE: " + std::string(what) + " failed");
}

int flow(double t, N_Vector x, N_Vector dxdt, void* ball)
{
    double* rate = NV_DATA_S(dxdt);
    static_cast<const BouncingBall*>(ball)->flow(t, NV_DATA_S(x), rate);
    return 0;
}

int guard(double t, N_Vector x, double* g, void* ball)
{
    *g = static_cast<const BouncingBall*>(ball)->guard(t, NV_DATA_S(x));
    return 0;
}

/// A solver that is allocated once and reinitialised for every run, as CVODE recommends.
class CvodeBall {
public:
    CvodeBall(const BallProblem& problem, double tolerance) : problem_(problem)
    {
        require(SUNContext_Create(nullptr, &context_), "SUNContext_Create");
        x_ = N_VNew_Serial(2, context_);
        memory_ = CVodeCreate(CV_ADAMS, context_);
        solver_ = SUNNonlinSol_FixedPoint(x_, 0, context_);
        require(CVodeInit(memory_, flow, 0, x_), "CVodeInit");
        require(CVodeSStolerances(memory_, tolerance, tolerance), "CVodeSStolerances");
        require(CVodeSetUserData(memory_, &problem_.system), "CVodeSetUserData");
        require(CVodeSetNonlinearSolver(memory_, solver_), "CVodeSetNonlinearSolver");
        require(CVodeSetMaxNumSteps(memory_, 100000), "CVodeSetMaxNumSteps");
        require(CVodeRootInit(memory_, 1, guard), "CVodeRootInit");
        int falling = -1;
        require(CVodeSetRootDirection(memory_, &falling), "CVodeSetRootDirection");
    }
    CvodeBall(const CvodeBall&) = delete;
    CvodeBall& operator=(const CvodeBall&) = delete;
    ~CvodeBall()
    {
        CVodeFree(&memory_);
        SUNNonlinSolFree(solver_);
        N_VDestroy(x_);
        SUNContext_Free(&context_);
    }

    [[nodiscard]] Answer run()
    {
        Answer answer{.finished = false, .steps = 0, .flow_calls = 0, .guard_calls = 0};
        double* x = NV_DATA_S(x_);
        x[0] = problem_.x0[0];
        x[1] = problem_.x0[1];
        restart(0);
        for (;;) {
            double t = 0;
            const int flag = CVode(memory_, problem_.t_end, x_, &t, CV_NORMAL);
            if (flag != CV_ROOT_RETURN) {
                answer.finished = flag == CV_SUCCESS;
                add_counts(answer);
                return answer;
            }
            answer.times.push_back(t);
            problem_.system.reset(t, x);
            add_counts(answer);
            restart(t);
        }
    }

private:
    void restart(double t) { require(CVodeReInit(memory_, t, x_), "CVodeReInit"); }

    /// CVODE's counts are reset at every initialisation.
    void add_counts(Answer& answer)
    {
        long steps = 0;
        long flows = 0;
        long guards = 0;
        CVodeGetNumSteps(memory_, &steps);
        CVodeGetNumRhsEvals(memory_, &flows);
        CVodeGetNumGEvals(memory_, &guards);
        *answer.steps += static_cast<std::uint64_t>(steps);
        *answer.flow_calls += static_cast<std::uint64_t>(flows);
        *answer.guard_calls += static_cast<std::uint64_t>(guards);
    }

    BallProblem problem_;
    SUNContext context_ = nullptr;
    N_Vector x_ = nullptr;
    void* memory_ = nullptr;
    SUNNonlinearSolver solver_ = nullptr;
};

}  // namespace

void add_cvode(CaseList& cases)
{
    for (const BallProblem& problem : {b1(), b2(), b3()}) {
        for (const double rtol : {1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13}) {
            const auto solver = std::make_shared<CvodeBall>(problem, rtol);
            cases.add_rival(
                problem.name, problem.events, {"cvode-adams", "root-finding", "rtol", rtol},
                [solver] { return solver->run(); }, [](Answer answer) { return answer; });
        }
    }
}

}  // namespace ricochet::bench
