// A spinning body of the Open Dynamics Engine that bounces off a floor, without the engine's own
// contacts: impacts to the last bit of the engine's motion, and rest after infinitely many.
#include <array>
#include <cstdio>
#include <ricochet/hosts/ode.hpp>

namespace {

struct Floor {
    using State = std::array<double, 6>;  ///< position [m], velocity [m/s]
    static constexpr bool unilateral = true;

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        dxdt = {x[3], x[4], x[5], 0, 0, -9.81};
    }
    [[nodiscard]] double guard(double /*t*/, const State& x) const { return x[2]; }
    void reset(double /*t*/, State& x) const
    {
        x[2] = 0;
        x[5] *= -0.6;
    }
    void rest(double /*t*/, State& x) const { x = {x[0], x[1], 0, 0, 0, 0}; }
};

}  // namespace

int main()
{
    dInitODE2(0);
    dWorldID world = dWorldCreate();
    dWorldSetGravity(world, 0, 0, -9.81);
    dBodyID body = dBodyCreate(world);
    dBodySetPosition(body, 0, 0, 3);
    dBodySetLinearVel(body, 1, 0, 0);
    dBodySetAngularVel(body, 1, 2, 3);

    const Floor floor;
    ricochet::hosts::OdeBody host({world, body}, 0, 0.01);
    ricochet::EventMonitor monitor(floor, Floor::State{});
    const ricochet::Verdict verdict = ricochet::hosts::run(host, monitor, 5, [](const auto& cut) {
        if (cut.accumulation) std::printf("%.9f s: at rest\n", cut.t.value);
    });
    std::printf("%zu events, the body lies at %.3f m\n", monitor.events().size(), host.x()[0]);

    dWorldDestroy(world);
    dCloseODE();
    return verdict == ricochet::Verdict::rests ? 0 : 1;
}
