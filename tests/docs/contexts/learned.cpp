// A type with member templates, which no function can declare, as a member of a class.
#include <array>
#include <cmath>
#include <ricochet/nn/guard_network.hpp>
#include <ricochet/ricochet.hpp>

using namespace ricochet;

namespace {
// clang-format off
struct Page
BLOCK
;
// clang-format on
using Ball = Page::Ball;

/// The plane y = 0.
Model plane()
{
    Model model;
    model.layers = {{.inputs = 2, .outputs = 1, .weight = {0, 1}, .bias = {0}}};
    return model;
}
}  // namespace

int main()
{
    const Ball ball{GuardNetwork(plane())};
    const Ball::State x0{0, 5, 1, 0};
    const auto run = integrate(ball, x0, {.t_end = 1.5}, ErrorControlled<Dopri5>{}, Enclosed{});
    return run.events.size() == 1 && run.x[3] > 0 ? 0 : 1;
}
