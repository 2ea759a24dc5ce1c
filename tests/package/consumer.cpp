// Code of a user of the installed package: every stepper on both main state types, and
// a network before the detector, with the user's own warnings.

#include <Eigen/Core>
#include <array>
#include <cstdio>
#include <vector>

#include "ricochet/gates.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/ricochet.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace {

template <class Stepping, class State>
bool bounces_thirteen_times(const State& start)
{
    const ricochet::BouncingBall ball;
    const ricochet::Options options{.t_end = 20.5, .step = 0.01};
    const auto newton = ricochet::integrate(ball, start, options, Stepping{});
    const auto bisection = ricochet::integrate(ball, start, options, Stepping{}, ricochet::Ends{},
                                               ricochet::Bisection{});
    const auto toms748 = ricochet::integrate(ball, start, options, Stepping{}, ricochet::Extremum{},
                                             ricochet::Toms748{});
    return newton.events.size() == 13 && bisection.events.size() == 13 &&
           toms748.events.size() == 13;
}

template <class State>
bool with_every_stepper(const State& start)
{
    using namespace ricochet;
    return bounces_thirteen_times<FixedStep<Rk4>>(start) &&
           bounces_thirteen_times<FixedStep<CashKarp54>>(start) &&
           bounces_thirteen_times<FixedStep<Dopri5>>(start) &&
           bounces_thirteen_times<FixedStep<Fehlberg78>>(start) &&
           bounces_thirteen_times<ErrorControlled<CashKarp54>>(start) &&
           bounces_thirteen_times<ErrorControlled<Dopri5>>(start) &&
           bounces_thirteen_times<ErrorControlled<Fehlberg78>>(start) &&
           integrate(BouncingBall(), start, {.t_end = 1, .step = 0.01}, FixedStep<Euler>{}).t == 1;
}

/// The network always answers "event", so that every step is examined.
bool with_networks()
{
    using namespace ricochet;
    Model model;
    model.system = "bouncing-ball";
    model.recipe = "state";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.step_min = model.step_max = 0.01;
    model.layers = {{.inputs = 2, .outputs = 1, .weight = {0, 0}, .bias = {1}}};
    const Options options{.t_end = 20.5, .step = 0.01};
    const auto bounces = [&](const auto& detector) {
        return integrate(BouncingBall(), {10.0, 0.0}, options, FixedStep<Rk4>{}, detector)
                   .events.size() == 13;
    };
    return bounces(BareNetwork(model)) && bounces(Verified<>(BareNetwork(model)));
}

}  // namespace

int main()
{
    const std::array<double, 2> array = {10.0, 0.0};
    const Eigen::VectorXd vector = Eigen::Vector2d(10.0, 0.0);
    const bool fine = with_every_stepper(array) && with_every_stepper(vector) && with_networks();
    std::puts(fine ? "fine" : "wrong number of impacts");
    return fine ? 0 : 1;
}
