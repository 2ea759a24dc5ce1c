// SUNDIALS ARKODE, ERKStep: the pair of Dormand and Prince with its own root finding, and
// ERKStepReInit after a reset. Setting up the memory, once, is not timed.
#include <arkode/arkode_erkstep.h>

#include <memory>

#include "sundials.hpp"

namespace ricochet::report {

namespace {

template <class S>
class Solver {
public:
    Solver(Task<S> task, double tolerance)
        : task_(std::move(task)), system_(task_.system), state_(task_.x0.size())
    {
        memory_ = ERKStepCreate(flow_of<S>, 0, state_.x, state_.context);
        require(ERKStepSetTableNum(memory_, ARKODE_DORMAND_PRINCE_7_4_5), "ERKStepSetTableNum");
        require(ERKStepSStolerances(memory_, tolerance, tolerance), "ERKStepSStolerances");
        require(ERKStepSetUserData(memory_, &system_), "ERKStepSetUserData");
        require(ERKStepSetMaxNumSteps(memory_, 1000000), "ERKStepSetMaxNumSteps");
        require(ERKStepSetErrHandlerFn(
                    memory_, [](int, const char*, const char*, char*, void*) {}, nullptr),
                "ERKStepSetErrHandlerFn");
        const std::size_t guards = system_.guards();
        if (guards > 0) {
            require(ERKStepRootInit(memory_, static_cast<int>(guards), guards_of<S>),
                    "ERKStepRootInit");
            std::vector<int> directions(guards, Seen<S>::direction());
            require(ERKStepSetRootDirection(memory_, directions.data()), "ERKStepSetRootDirection");
            require(ERKStepSetNoInactiveRootWarn(memory_), "ERKStepSetNoInactiveRootWarn");
        }
    }
    Solver(const Solver&) = delete;
    Solver& operator=(const Solver&) = delete;
    ~Solver() { ERKStepFree(&memory_); }

    bool run(Answer& answer, std::size_t offset)
    {
        return drive(
            system_, task_, state_.x, answer, offset, ARK_ROOT_RETURN,
            [&](double t_end, double* t) {
                return ERKStepEvolve(memory_, t_end, state_.x, t, ARK_NORMAL);
            },
            [&](int* flags) { ERKStepGetRootInfo(memory_, flags); },
            [&](double t) {
                require(ERKStepReInit(memory_, flow_of<S>, t, state_.x), "ERKStepReInit");
            });
    }

private:
    Task<S> task_;
    Seen<S> system_;
    State state_;
    void* memory_ = nullptr;
};

}  // namespace

void add_arkode(Cells& cells)
{
    cells.add_version("ARKODE", sundials_version());
    add_solver_cells<Solver>(cells, "ARKODE", "DP5, root finding");
}

}  // namespace ricochet::report
