// Code shared by the solvers of SUNDIALS: a system behind their callbacks.
#pragma once

#include <nvector/nvector_serial.h>
#include <sundials/sundials_version.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "cells.hpp"
#include "seen.hpp"

namespace ricochet::report {

inline void require(int flag, const char* what)
{
    if (flag < 0) {
        throw std::runtime_error(std::string(what) + " returned " + std::to_string(flag));
    }
}

[[nodiscard]] inline std::string sundials_version()
{
    char text[32] = "";
    SUNDIALSGetVersion(text, sizeof text);
    return text;
}

template <class S>
int flow_of(double t, N_Vector x, N_Vector dxdt, void* user)
{
    double* rate = NV_DATA_S(dxdt);
    static_cast<Seen<S>*>(user)->flow(t, NV_DATA_S(x), rate);
    return 0;
}

template <class S>
int guards_of(double t, N_Vector x, double* g, void* user)
{
    auto* system = static_cast<Seen<S>*>(user);
    for (std::size_t i = 0; i < system->guards(); ++i) g[i] = system->guard(i, t, NV_DATA_S(x));
    return 0;
}

/// A context and a state, which live as long as the solver.
class State {
public:
    explicit State(std::size_t n)
    {
        require(SUNContext_Create(nullptr, &context), "SUNContext_Create");
        x = N_VNew_Serial(static_cast<sunindextype>(n), context);
    }
    State(const State&) = delete;
    State& operator=(const State&) = delete;
    ~State()
    {
        N_VDestroy(x);
        SUNContext_Free(&context);
    }

    SUNContext context = nullptr;
    N_Vector x = nullptr;
};

/// Goes from event to event: `to(t_end, t)` continues, `fired(which)` are the flags of the guards
/// after a root, `again(t)` reinitialises the solver after a reset.
template <class S, class To, class Fired, class Again>
bool drive(Seen<S>& system, const Task<S>& task, N_Vector state, Answer& answer, std::size_t offset,
           int root_flag, const To& to, const Fired& fired, const Again& again)
{
    double* x = NV_DATA_S(state);
    std::copy(task.x0.begin(), task.x0.end(), x);
    system.mode = 0;
    system.flow_calls = system.guard_calls = 0;
    again(0.0);
    std::vector<int> flags(std::max<std::size_t>(system.guards(), 1));
    bool finished = true;
    for (double t = 0; t < task.t_end;) {
        const int flag = to(task.t_end, &t);
        if (flag < 0) {
            answer.note = "error flag " + std::to_string(flag);
            finished = false;
            break;
        }
        if (flag != root_flag) break;
        fired(flags.data());
        for (std::size_t i = 0; i < system.guards(); ++i) {
            if (flags[i] == 0) continue;
            answer.add(t, i + offset);
            system.reset(i, t, x);
        }
        if (Seen<S>::acts) again(t);
    }
    note_energy(task, x, answer);
    *answer.flow_calls += system.flow_calls;
    *answer.guard_calls += system.guard_calls;
    return finished;
}

/// Adds the cells of every problem by a solver `Solver<S>` made of a task and a tolerance.
template <template <class> class Solver>
void add_solver_cells(Cells& cells, const std::string& peer, const std::string& setting)
{
    for_each_problem([&](const std::string& name, const std::string& /*title*/, const auto& make) {
        using S = decltype(make().front().system);
        for (const double tolerance : tolerances_of(name)) {
            cells.add({name, peer, setting, tolerance, [make, tolerance] {
                           std::vector<std::shared_ptr<Solver<S>>> solvers;
                           for (auto& task : make()) {
                               solvers.push_back(std::make_shared<Solver<S>>(task, tolerance));
                           }
                           return [solvers] {
                               Answer answer{.finished = true, .flow_calls = 0, .guard_calls = 0};
                               for (std::size_t k = 0; k < solvers.size(); ++k) {
                                   answer.finished &= solvers[k]->run(answer, guards_of_a_run * k);
                               }
                               return answer;
                           };
                       }});
        }
    });
}

}  // namespace ricochet::report
