// The Open Dynamics Engine on the ball: a sphere above a plane, contacts by its collision space,
// restitution 0.9, steps of constant length. An impact is the step in which the velocity turns.
#include <ode/ode.h>

#include "cells.hpp"

namespace ricochet::report {

namespace {

constexpr double radius = 0.125;

struct World {
    dWorldID world;
    dSpaceID space;
    dJointGroupID contacts;
};

void on_near(void* data, dGeomID a, dGeomID b)
{
    const auto* in = static_cast<World*>(data);
    dContact contact{};
    contact.surface.mode = dContactBounce;
    contact.surface.mu = 0;
    contact.surface.bounce = 0.9;
    contact.surface.bounce_vel = 0;
    if (dCollide(a, b, 1, &contact.geom, sizeof(dContact)) == 0) return;
    const dJointID joint = dJointCreateContact(in->world, in->contacts, &contact);
    dJointAttach(joint, dGeomGetBody(a), dGeomGetBody(b));
}

Answer run(double step)
{
    const Task<Ball> task = ball();
    World in{dWorldCreate(), dSimpleSpaceCreate(nullptr), dJointGroupCreate(0)};
    dWorldSetGravity(in.world, 0, 0, -task.system.gravity);
    dCreatePlane(in.space, 0, 0, 1, 0);
    const dBodyID body = dBodyCreate(in.world);
    dBodySetPosition(body, 0, 0, task.x0[0] + radius);
    const dGeomID sphere = dCreateSphere(in.space, radius);
    dGeomSetBody(sphere, body);
    Answer answer{.finished = true, .steps = 0};
    double before = 0;
    for (double t = 0; t < task.t_end; t += step) {
        dSpaceCollide(in.space, &in, on_near);
        dWorldStep(in.world, step);
        dJointGroupEmpty(in.contacts);
        const double v = dBodyGetLinearVel(body)[2];
        if (before < 0 && v > 0) answer.add(t, 0);
        before = v;
        ++*answer.steps;
    }
    dJointGroupDestroy(in.contacts);
    dSpaceDestroy(in.space);
    dWorldDestroy(in.world);
    return answer;
}

}  // namespace

void add_ode(Cells& cells)
{
    dInitODE2(0);
    cells.add_version("ODE", RICOCHET_REPORT_ODE_VERSION);
    for (const double step : {1e-2, 1e-3, 1e-4, 1e-5}) {
        cells.add({"ball", "ODE", "contacts, constant step", step,
                   [step] { return [step] { return run(step); }; }});
    }
}

}  // namespace ricochet::report
