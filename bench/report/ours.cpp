// ricochet itself: Runge-Kutta methods with the default detector.
#include "cells.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"

namespace ricochet::report {

namespace {

template <class Stepping, class S>
bool solve(const Task<S>& task, double tolerance, Answer& answer, std::size_t offset)
{
    const auto run = integrate(
        task.system, task.x0,
        {.t_end = task.t_end, .rtol = tolerance, .atol = tolerance, .event_states = false},
        Stepping{});
    for (const auto& event : run.events) {
        if (event.kind != EventKind::touch) answer.add(event.t, event.guard + offset);
    }
    note_energy(task, run.x, answer);
    *answer.steps += run.statistics.steps;
    *answer.flow_calls += run.statistics.flow_calls;
    *answer.guard_calls += run.statistics.guard_calls;
    if (run.outcome != Outcome::reached_end) answer.note = describe(run.outcome);
    return run.outcome == Outcome::reached_end;
}

template <class Stepping, class Make>
void add_method(Cells& cells, const std::string& problem, const std::string& how, const Make& make)
{
    for (const double tolerance : tolerances_of(problem)) {
        cells.add({problem, "ricochet", how, tolerance, [make, tolerance] {
                       return over(make(), [tolerance](const auto& task, Answer& answer,
                                                       std::size_t offset) {
                           return solve<Stepping>(task, tolerance, answer, offset);
                       });
                   }});
    }
}

}  // namespace

void add_ours(Cells& cells)
{
    cells.add_version("ricochet", RICOCHET_REPORT_VERSION);
    for_each_problem([&](const std::string& name, const std::string& title, const auto& make) {
        cells.add_reference([=] { return reference_of(name, title, make()); });
        add_method<ErrorControlled<Dopri5>>(cells, name, "dopri5", make);
        add_method<ErrorControlled<Fehlberg78>>(cells, name, "fehlberg78", make);
    });
}

}  // namespace ricochet::report
