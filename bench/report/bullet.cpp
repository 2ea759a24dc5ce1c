// Bullet: bodies among static planes, steps of constant length. An impact is the step in which the
// velocity turns, a collision the first of the steps in which a pair has an impulse.
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "cells.hpp"

namespace ricochet::report {

namespace {

/// A world that owns its bodies.
class World {
public:
    explicit World(double gravity) { world.setGravity({0, 0, btScalar(-gravity)}); }
    World(const World&) = delete;
    World& operator=(const World&) = delete;
    ~World()
    {
        for (btRigidBody& body : bodies) world.removeRigidBody(&body);
    }

    /// Adds a body. A body with mass zero is static.
    btRigidBody& add(btCollisionShape* shape, double mass, const btVector3& at, double restitution,
                     double friction)
    {
        btVector3 inertia(0, 0, 0);
        if (mass > 0) shape->calculateLocalInertia(btScalar(mass), inertia);
        btRigidBody& body = bodies.emplace_back(
            btRigidBody::btRigidBodyConstructionInfo(btScalar(mass), nullptr, shape, inertia));
        body.setRestitution(btScalar(restitution));
        body.setFriction(btScalar(friction));
        body.setActivationState(DISABLE_DEACTIVATION);
        btTransform place = btTransform::getIdentity();
        place.setOrigin(at);
        body.setCenterOfMassTransform(place);
        world.addRigidBody(&body);
        return body;
    }
    void step(double length) { world.stepSimulation(btScalar(length), 0); }

private:
    btDefaultCollisionConfiguration configuration_;

public:
    btCollisionDispatcher dispatcher{&configuration_};

private:
    btDbvtBroadphase broadphase_;
    btSequentialImpulseConstraintSolver solver_;

public:
    btDiscreteDynamicsWorld world{&dispatcher, &broadphase_, &solver_, &configuration_};
    std::deque<btRigidBody> bodies;
};

Answer bounce(double step)
{
    constexpr btScalar radius(0.125);
    const Task<Ball> task = ball();
    btStaticPlaneShape plane({0, 0, 1}, 0);
    btSphereShape sphere(radius);
    World in(task.system.gravity);
    in.add(&plane, 0, {0, 0, 0}, 1, 0.5);
    btRigidBody& body = in.add(&sphere, 1, {0, 0, btScalar(task.x0[0]) + radius}, 0.9, 0.5);
    Answer answer{.finished = true, .steps = 0};
    double before = 0;
    for (double t = 0; t < task.t_end; t += step) {
        in.step(step);
        const double v = double(body.getLinearVelocity().z());
        if (before < 0 && v > 0) answer.add(t, 0);
        before = v;
        ++*answer.steps;
    }
    return answer;
}

/// A block of 1 m x 1 m x 0.1 m, or a ball; friction is the product of that of both bodies.
Answer slide(bool rolls, double step)
{
    const auto height = static_cast<btScalar>(rolls ? sliding::radius : 0.05);
    btStaticPlaneShape plane({0, 0, 1}, 0);
    btSphereShape sphere(height);
    btBoxShape box({btScalar(0.5), btScalar(0.5), height});
    World in(sliding::gravity);
    in.add(&plane, 0, {0, 0, 0}, 0, 1);
    btCollisionShape* shape = &box;
    if (rolls) shape = &sphere;
    btRigidBody& body = in.add(shape, 1, {0, 0, height}, 0, sliding::friction);
    body.setLinearVelocity({btScalar(sliding::start), 0, 0});
    // [m/s] Single precision and ten iterations leave a larger residual velocity than other
    // engines.
    constexpr double noise = 1e-4 * sliding::start;
    Answer answer{.finished = true, .steps = 0};
    EndOfSliding end;
    for (double t = step; t < sliding::t_end; t += step) {
        in.step(step);
        const btScalar spin = rolls ? height * body.getAngularVelocity().y() : btScalar(0);
        const auto speed = double(body.getLinearVelocity().x() - spin);
        end.see(t, std::abs(speed) > noise ? speed : 0, answer);
        ++*answer.steps;
    }
    return answer;
}

/// Numbers of the guards that have an impulse after a step, in order.
void find_struck(btCollisionDispatcher& dispatcher, std::size_t discs,
                 std::vector<std::size_t>& out)
{
    out.clear();
    for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
        const btPersistentManifold* manifold = dispatcher.getManifoldByIndexInternal(k);
        double impulse = 0;
        for (int i = 0; i < manifold->getNumContacts(); ++i) {
            impulse += double(manifold->getContactPoint(i).getAppliedImpulse());
        }
        if (!(impulse > 0)) continue;
        const auto [low, high] =
            std::minmax({static_cast<std::size_t>(manifold->getBody0()->getUserIndex()),
                         static_cast<std::size_t>(manifold->getBody1()->getUserIndex())});
        out.push_back(high < discs ? pair_guard(low, high) : wall_guard(discs, low, high - discs));
    }
    std::sort(out.begin(), out.end());
}

/// Lengths are in centimetres, since Bullet's manual recommends bodies of 0.05 to 10 units.
Answer collide(std::size_t discs, double step)
{
    constexpr double unit = 100;
    const Scene scene = gas_scene(discs);
    std::deque<btStaticPlaneShape> planes;
    std::deque<btSphereShape> spheres;
    World in(0);
    const btVector3 normals[4] = {{0, 1, 0}, {1, 0, 0}, {0, -1, 0}, {-1, 0, 0}};
    for (const Disc& disc : scene.bodies()) {
        spheres.emplace_back(btScalar(unit * disc.radius));
        btRigidBody& body =
            in.add(&spheres.back(), disc.mass,
                   {btScalar(unit * disc.at[0]), btScalar(unit * disc.at[1]), 0}, 1, 0);
        body.setUserIndex(static_cast<int>(spheres.size()) - 1);
        body.setLinearFactor({1, 1, 0});
        body.setLinearVelocity(
            {btScalar(unit * disc.velocity[0]), btScalar(unit * disc.velocity[1]), 0});
    }
    for (int k = 0; k < 4; ++k) {
        planes.emplace_back(normals[k], btScalar(k < 2 ? 0 : -unit));
        in.add(&planes.back(), 0, {0, 0, 0}, 1, 0).setUserIndex(static_cast<int>(discs) + k);
    }
    Answer answer{.finished = true, .steps = 0};
    std::vector<std::size_t> before;
    std::vector<std::size_t> struck;
    for (double t = 0; t < gas_end(discs); t += step) {
        in.step(step);
        find_struck(in.dispatcher, discs, struck);
        for (const std::size_t guard : struck) {
            if (!std::binary_search(before.begin(), before.end(), guard)) answer.add(t, guard);
        }
        before.swap(struck);
        ++*answer.steps;
    }
    std::vector<BodyState> states;
    for (std::size_t i = 0; i < discs; ++i) {
        const btVector3& v = in.bodies[i].getLinearVelocity();
        states.push_back({{0, 0}, {double(v.x()) / unit, double(v.y()) / unit}});
    }
    answer.energy_change = energy(scene, states) / energy(scene, test::start_of(scene)) - 1;
    return answer;
}

}  // namespace

void add_bullet(Cells& cells)
{
    cells.add_version("Bullet", std::to_string(btGetVersion() / 100) + "." +
                                    std::to_string(btGetVersion() % 100) +
                                    (sizeof(btScalar) == 4 ? ", single precision" : ""));
    const std::string how = "contacts, constant step";
    for (const double step : {1e-2, 1e-3, 1e-4, 1e-5}) {
        cells.add({"ball", "Bullet", how, step, [=] { return [=] { return bounce(step); }; }});
    }
    for (const double step : {1e-2, 1e-3, 1e-4}) {
        cells.add(
            {"block", "Bullet", how, step, [=] { return [=] { return slide(false, step); }; }});
        cells.add(
            {"rolling", "Bullet", how, step, [=] { return [=] { return slide(true, step); }; }});
    }
    for_each_gas_step([&](std::size_t discs, double step) {
        if (discs > 1000) return;  // runs take tens of seconds
        cells.add({"gas-" + std::to_string(discs), "Bullet", how, step,
                   [=] { return [=] { return collide(discs, step); }; }});
    });
}

}  // namespace ricochet::report
