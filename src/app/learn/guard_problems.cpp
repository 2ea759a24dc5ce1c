#include "guard_problems.hpp"

#include <algorithm>

#include "model_lookup.hpp"
#include "registry.hpp"
#include "systems/scenes.hpp"

namespace ricochet::app {

namespace {

/// The height is a component of the state, and independent of parameters.
learn::GuardProblem ball_problem(const Model& model)
{
    learn::detail::check_certifiable(model, "bouncing-ball", 2);
    return {.guard = [](const double* x) { return x[0]; },
            .slack = [](const double* half_widths) { return half_widths[0]; }};
}

learn::GuardProblem cavern_problem(const Model& model)
{
    const Cavern made = cavern_of(parameters_of(find_system(Cavern::name), model));
    return learn::guard_problem(made, model, made.start());
}

learn::GuardProblem arm_problem(const Model& model)
{
    const Arm made = arm_of(parameters_of(find_system(Arm::name), model));
    return learn::guard_problem(made, model, made.start());
}

/// Proofs evaluate bounds over many boxes, so a table pays.
learn::GuardProblem eigenvalue_problem(const Model& model)
{
    std::vector<double> p = parameters_of(find_system(LeastEigenvalue::name), model);
    constexpr std::size_t table = 5;  // among the parameters
    p[table] = std::max(p[table], 16.0);
    const LeastEigenvalue made = eigenvalue_of(p);
    return learn::guard_problem(made, model, made.start());
}

}  // namespace

const std::vector<GuardProblemOf>& guard_problems()
{
    static const std::vector<GuardProblemOf> all{{"bouncing-ball", ball_problem},
                                                 {Cavern::name, cavern_problem},
                                                 {LeastEigenvalue::name, eigenvalue_problem},
                                                 {Arm::name, arm_problem}};
    return all;
}

}  // namespace ricochet::app
