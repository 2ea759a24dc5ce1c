// A body of the Open Dynamics Engine as a host: the world continues in steps of a fixed length, and
// events are located by putting the body back and taking the step again, shorter.
//
//     hosts::OdeBody host({world, body}, t, 0.01);
//
// A repeated step moves the whole world. The engine cannot list its bodies: those that move beside
// this one are named, and are put back with it.
//
//     hosts::OdeBody host({world, body, dWorldQuickStep, {second, third}}, t, 0.01);
//
// Repeated steps include the forces of the world (gravity, joints), not those that the program has
// added for one step.
#pragma once

#include <ode/ode.h>

#include <algorithm>
#include <array>
#include <vector>

#include "ricochet/hosts/detail/body_step.hpp"

namespace ricochet::hosts {

/// A body in its world.
struct OdeEngine {
    dWorldID world;
    dBodyID body;
    int (*step)(dWorldID, dReal) = dWorldQuickStep;  ///< or dWorldStep

    std::vector<dBodyID> others{};  ///< that move in this world, too

    /// Motion of one body.
    struct Motion {
        std::array<double, 6> x{};
        std::array<dReal, 4> attitude{};
        std::array<dReal, 3> spin{};
    };
    /// State of the world that a repeated step starts from.
    struct Body : Motion {
        std::vector<Motion> others{};
    };
    [[nodiscard]] Body read() const
    {
        Body at{read(body)};
        for (dBodyID other : others) at.others.push_back(read(other));
        return at;
    }
    void write(const Body& at) const
    {
        write(body, at);
        for (std::size_t i = 0; i < others.size(); ++i) write(others[i], at.others[i]);
    }
    [[nodiscard]] static Motion read(dBodyID of)
    {
        Motion at;
        std::copy_n(dBodyGetPosition(of), 3, at.x.begin());
        std::copy_n(dBodyGetLinearVel(of), 3, at.x.begin() + 3);
        std::copy_n(dBodyGetQuaternion(of), 4, at.attitude.begin());
        std::copy_n(dBodyGetAngularVel(of), 3, at.spin.begin());
        return at;
    }
    static void write(dBodyID of, const Motion& at)
    {
        dBodySetPosition(of, dReal(at.x[0]), dReal(at.x[1]), dReal(at.x[2]));
        dBodySetLinearVel(of, dReal(at.x[3]), dReal(at.x[4]), dReal(at.x[5]));
        dBodySetQuaternion(of, at.attitude.data());
        dBodySetAngularVel(of, at.spin[0], at.spin[1], at.spin[2]);
    }
    void advance(double s) const { step(world, dReal(s)); }
    [[nodiscard]] double gravity(std::size_t i) const
    {
        dVector3 g;
        dWorldGetGravity(world, g);
        return g[i];
    }
};

/// x = (position [m], velocity [m/s]) of the body's centre. The rotation goes with it.
using OdeBody = detail::BodyStep<OdeEngine>;

}  // namespace ricochet::hosts
