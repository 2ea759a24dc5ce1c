// The Open Dynamics Engine: bodies above planes, contacts by its collision spaces, steps of
// constant length by its exact solver, and by its iterative one for the gas, as its manual advises
// for many bodies. An impact is the step in which the velocity turns; a collision is a step in
// which a pair overlaps and approaches.
#include <ode/ode.h>

#include <algorithm>
#include <cmath>

#include "cells.hpp"

namespace ricochet::report {

namespace {

/// A world, its space and the contacts of a step.
class World {
public:
    World() : space(dHashSpaceCreate(nullptr)) {}
    World(const World&) = delete;
    World& operator=(const World&) = delete;
    ~World()
    {
        dJointGroupDestroy(contacts);
        dSpaceDestroy(space);
        dWorldDestroy(world);
    }

    /// A body whose index is kept with its geometry.
    dBodyID add(dGeomID geom, const dMass& mass, double x, double y, double z,
                std::size_t index = 0)
    {
        const dBodyID body = dBodyCreate(world);
        dBodySetMass(body, &mass);
        dBodySetPosition(body, x, y, z);
        dGeomSetBody(geom, body);
        dGeomSetData(geom, reinterpret_cast<void*>(index));
        return body;
    }

    dWorldID world = dWorldCreate();
    dSpaceID space;
    dJointGroupID contacts = dJointGroupCreate(0);
    dSurfaceParameters surface{};
    double t = 0;              ///< [s] start of the step
    std::size_t bodies = 0;    ///< number of bodies whose collisions are recorded
    Answer* answer = nullptr;  ///< receives them

    void step(double length, bool iterative = false)
    {
        dSpaceCollide(space, this, on_near);
        iterative ? dWorldQuickStep(world, length) : dWorldStep(world, length);
        dJointGroupEmpty(contacts);
        t += length;
    }

private:
    static constexpr int most_contacts = 8;

    static void on_near(void* data, dGeomID a, dGeomID b)
    {
        auto* in = static_cast<World*>(data);
        dContactGeom found[most_contacts];
        const int n = dCollide(a, b, most_contacts, found, sizeof(dContactGeom));
        for (int k = 0; k < n; ++k) {
            dContact contact{};
            contact.surface = in->surface;
            contact.geom = found[k];
            const dJointID joint = dJointCreateContact(in->world, in->contacts, &contact);
            dJointAttach(joint, dGeomGetBody(a), dGeomGetBody(b));
        }
        if (n > 0 && in->answer != nullptr) in->record(a, b, found[0].normal);
    }

    /// The normal points into a.
    void record(dGeomID a, dGeomID b, const dVector3 normal)
    {
        double rate = 0;
        for (const auto& [geom, sign] : {std::pair{a, 1.0}, {b, -1.0}}) {
            const dBodyID body = dGeomGetBody(geom);
            if (body == nullptr) continue;
            const dReal* v = dBodyGetLinearVel(body);
            rate += sign * (v[0] * normal[0] + v[1] * normal[1]);
        }
        if (!(rate < 0)) return;
        const auto index = [](dGeomID geom) {
            return reinterpret_cast<std::size_t>(dGeomGetData(geom));
        };
        const bool is_wall = dGeomGetBody(a) == nullptr || dGeomGetBody(b) == nullptr;
        const auto [low, high] = dGeomGetBody(a) == nullptr ? std::pair{index(b), index(a)}
                                 : is_wall                  ? std::pair{index(a), index(b)}
                                                            : std::minmax({index(a), index(b)});
        answer->add(t, is_wall ? wall_guard(bodies, low, high) : pair_guard(low, high));
    }
};

Answer bounce(double step)
{
    constexpr double radius = 0.125;
    const Task<Ball> task = ball();
    World in;
    in.surface.mode = dContactBounce;
    in.surface.bounce = 0.9;
    dWorldSetGravity(in.world, 0, 0, -task.system.gravity);
    dCreatePlane(in.space, 0, 0, 1, 0);
    dMass mass;
    dMassSetSphereTotal(&mass, 1, radius);
    const dBodyID body = in.add(dCreateSphere(in.space, radius), mass, 0, 0, task.x0[0] + radius);
    Answer answer{.finished = true, .steps = 0};
    double before = 0;
    while (in.t < task.t_end) {
        const double t = in.t;
        in.step(step);
        const double v = dBodyGetLinearVel(body)[2];
        if (before < 0 && v > 0) answer.add(t, 0);
        before = v;
        ++*answer.steps;
    }
    return answer;
}

/// A block of 1 m x 1 m x 0.1 m, or a ball, with Coulomb friction by its pyramid.
Answer slide(bool rolls, double step)
{
    const double height = rolls ? sliding::radius : 0.05;
    World in;
    in.surface.mode = dContactApprox1;
    in.surface.mu = sliding::friction;
    dWorldSetGravity(in.world, 0, 0, -sliding::gravity);
    dCreatePlane(in.space, 0, 0, 1, 0);
    dMass mass;
    dGeomID geom;
    if (rolls) {
        dMassSetSphereTotal(&mass, 1, height);
        geom = dCreateSphere(in.space, height);
    } else {
        dMassSetBoxTotal(&mass, 1, 1, 1, 2 * height);
        geom = dCreateBox(in.space, 1, 1, 2 * height);
    }
    const dBodyID body = in.add(geom, mass, 0, 0, height);
    dBodySetLinearVel(body, sliding::start, 0, 0);
    Answer answer{.finished = true, .steps = 0};
    EndOfSliding end;
    while (in.t < sliding::t_end) {
        in.step(step);
        const double spin = rolls ? height * dBodyGetAngularVel(body)[1] : 0.0;
        end.see(in.t, dBodyGetLinearVel(body)[0] - spin, answer);
        ++*answer.steps;
    }
    return answer;
}

Answer collide(std::size_t discs, double step)
{
    const Scene scene = gas_scene(discs);
    World in;
    in.surface.mode = dContactBounce;
    in.surface.bounce = 1;
    in.bodies = discs;
    constexpr double planes[4][3] = {{0, 1, 0}, {1, 0, 0}, {0, -1, -1}, {-1, 0, -1}};
    for (std::size_t k = 0; k < 4; ++k) {
        const auto& [a, b, d] = planes[k];
        dGeomSetData(dCreatePlane(in.space, a, b, 0, d), reinterpret_cast<void*>(k));
    }
    std::vector<dBodyID> bodies;
    for (const Disc& disc : scene.bodies()) {
        dMass mass;
        dMassSetSphereTotal(&mass, disc.mass, disc.radius);
        bodies.push_back(in.add(dCreateSphere(in.space, disc.radius), mass, disc.at[0], disc.at[1],
                                0, bodies.size()));
        dBodySetLinearVel(bodies.back(), disc.velocity[0], disc.velocity[1], 0);
    }
    Answer answer{.finished = true, .steps = 0};
    in.answer = &answer;
    while (in.t < gas_end(discs)) {
        in.step(step, true);
        ++*answer.steps;
    }
    std::vector<BodyState> states;
    for (const dBodyID body : bodies) {
        const dReal* v = dBodyGetLinearVel(body);
        states.push_back({{0, 0}, {v[0], v[1]}});
    }
    answer.energy_change = energy(scene, states) / energy(scene, test::start_of(scene)) - 1;
    return answer;
}

}  // namespace

void add_ode(Cells& cells)
{
    dInitODE2(0);
    cells.add_version("ODE", RICOCHET_REPORT_ODE_VERSION);
    const std::string how = "contacts, constant step";
    for (const double step : {1e-2, 1e-3, 1e-4, 1e-5}) {
        cells.add({"ball", "ODE", how, step, [=] { return [=] { return bounce(step); }; }});
    }
    for (const double step : {1e-2, 1e-3, 1e-4}) {
        cells.add({"block", "ODE", how, step, [=] { return [=] { return slide(false, step); }; }});
        cells.add({"rolling", "ODE", how, step, [=] { return [=] { return slide(true, step); }; }});
    }
    for_each_gas_step([&](std::size_t discs, double step) {
        if (discs > 1000) return;  // runs take tens of seconds
        cells.add({"gas-" + std::to_string(discs), "ODE", "quick step, constant", step,
                   [=] { return [=] { return collide(discs, step); }; }});
    });
}

}  // namespace ricochet::report
