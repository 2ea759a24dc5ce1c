// A light gate in a world of Bullet: the world continues as it does, and its tick callback shows
// every tick to a monitor, which records when a body passes the gate, finer than the ticks.
#include <array>
#include <cmath>
#include <cstdio>
#include <ricochet/hosts/bullet.hpp>

namespace {

struct LightGate {
    using State = std::array<double, 6>;  ///< position [m], velocity [m/s]
    static constexpr bool resets = false;
    static constexpr ricochet::Crossing crossing = ricochet::Crossing::either;

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        dxdt = {x[3], x[4], x[5], 0, 0, -9.81};
    }
    [[nodiscard]] double guard(double /*t*/, const State& x) const { return x[2] - 1; }
};

/// The body's state before and after each tick.
struct Watch {
    const btRigidBody* body;
    double t = 0;
    LightGate gate{};
    LightGate::State x{}, rate{};
    ricochet::EventMonitor<LightGate, LightGate::State> monitor{gate, x};

    explicit Watch(const btRigidBody& of) : body(&of)
    {
        x = read();
        gate.flow(t, x, rate);
        (void)monitor.start({t}, x, rate, 1.0 / 60);
    }

    [[nodiscard]] LightGate::State read() const
    {
        const btVector3& at = body->getWorldTransform().getOrigin();
        const btVector3& v = body->getLinearVelocity();
        return {at[0], at[1], at[2], v[0], v[1], v[2]};
    }

    static void after_tick(btDynamicsWorld* world, btScalar length)
    {
        auto& watch = *static_cast<Watch*>(world->getWorldUserInfo());
        const double h = length;
        const LightGate::State end = watch.read();
        LightGate::State rate0 = watch.rate;
        // Of the engine's motion: x(s) = x0 + s v(s), v(s) = v0 + s a.
        for (std::size_t i = 0; i < 3; ++i) {
            const double a = (end[3 + i] - watch.x[3 + i]) / h;
            rate0[i] = watch.x[3 + i];
            watch.rate[i] = end[3 + i] + h * a;
            rate0[3 + i] = watch.rate[3 + i] = a;
        }
        const ricochet::HermiteStep step({watch.t}, h, watch.x, end, rate0, watch.rate);
        (void)watch.monitor.examine(step);
        watch.t += h;
        watch.x = end;
    }
};

}  // namespace

int main()
{
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity({0, 0, btScalar(-9.81)});
    btSphereShape shape(btScalar(0.1));
    btRigidBody body(btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape));
    world.addRigidBody(&body);
    body.setLinearVelocity({0, 0, 6});

    Watch watch(body);
    world.setInternalTickCallback(Watch::after_tick, &watch);
    for (int frame = 0; frame < 90; ++frame) world.stepSimulation(btScalar(1.0 / 60));
    for (const auto& passage : watch.monitor.events()) {
        std::printf("%.4f s at %+.3f m/s\n", passage.t, passage.before[5]);
    }
    world.removeRigidBody(&body);
    // By the physics 0.199 s and 1.024 s; the engine is of first order.
    const auto events = watch.monitor.events();
    return events.size() == 2 && std::fabs(events[0].t - 0.2) < 0.02 ? 0 : 1;
}
