// ricochet itself: Taylor series of the flow.
#include "ricochet/taylor/taylor.hpp"

#include "cells.hpp"
#include "ricochet/integrate.hpp"

namespace ricochet::report {

namespace {

template <class S>
bool solve(const Task<S>& task, double tolerance, Answer& answer, std::size_t offset)
{
    const auto run = integrate(
        task.system, task.x0,
        {.t_end = task.t_end, .rtol = tolerance, .atol = tolerance, .event_states = false},
        ErrorControlled<Taylor>{});
    for (const auto& event : run.events) {
        if (event.kind != EventKind::touch) answer.add(event.t, event.guard + offset);
    }
    *answer.steps += run.statistics.steps;
    *answer.flow_calls += run.statistics.flow_calls;
    *answer.guard_calls += run.statistics.guard_calls;
    if (run.outcome != Outcome::reached_end) answer.note = describe(run.outcome);
    return run.outcome == Outcome::reached_end;
}

}  // namespace

void add_taylor(Cells& cells)
{
    for_each_problem([&](const std::string& name, const std::string& /*title*/, const auto& make) {
        using Task = typename std::decay_t<decltype(make())>::value_type;
        using System = decltype(Task::system);
        // States of fixed size, whose flow is a template over its scalar, too.
        if constexpr (!std::is_same_v<typename System::State, std::vector<double>> &&
                      !std::is_same_v<System, Watched> && !std::is_same_v<System, Unwatched>) {
            for (const double tolerance : tolerances_of(name)) {
                cells.add({name, "ricochet", "Taylor", tolerance, [make, tolerance] {
                               return over(make(), [tolerance](const auto& task, Answer& answer,
                                                               std::size_t offset) {
                                   return solve(task, tolerance, answer, offset);
                               });
                           }});
            }
        }
    });
}

}  // namespace ricochet::report
