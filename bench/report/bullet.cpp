// Bullet on the ball: a sphere above a static plane, restitution 0.9, steps of constant length. An
// impact is the step in which the velocity turns.
#include <btBulletDynamicsCommon.h>

#include "cells.hpp"

namespace ricochet::report {

namespace {

constexpr btScalar radius(0.125);

Answer run(double step)
{
    const Task<Ball> task = ball();
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity({0, 0, btScalar(-task.system.gravity)});
    btStaticPlaneShape plane({0, 0, 1}, 0);
    btSphereShape sphere(radius);
    btRigidBody ground(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &plane));
    btRigidBody body(btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &sphere, {1, 1, 1}));
    ground.setRestitution(1);
    body.setRestitution(btScalar(0.9));
    body.setActivationState(DISABLE_DEACTIVATION);
    btTransform place = btTransform::getIdentity();
    place.setOrigin({0, 0, btScalar(task.x0[0]) + radius});
    body.setCenterOfMassTransform(place);
    world.addRigidBody(&ground);
    world.addRigidBody(&body);
    Answer answer{.finished = true, .steps = 0};
    double before = 0;
    for (double t = 0; t < task.t_end; t += step) {
        world.stepSimulation(btScalar(step), 0);
        const double v = double(body.getLinearVelocity().z());
        if (before < 0 && v > 0) answer.add(t, 0);
        before = v;
        ++*answer.steps;
    }
    world.removeRigidBody(&body);
    world.removeRigidBody(&ground);
    return answer;
}

}  // namespace

void add_bullet(Cells& cells)
{
    cells.add_version("Bullet", std::to_string(btGetVersion() / 100) + "." +
                                    std::to_string(btGetVersion() % 100) +
                                    (sizeof(btScalar) == 4 ? ", single precision" : ""));
    for (const double step : {1e-2, 1e-3, 1e-4, 1e-5}) {
        cells.add({"ball", "Bullet", "contacts, constant step", step,
                   [step] { return [step] { return run(step); }; }});
    }
}

}  // namespace ricochet::report
