// A body of the Open Dynamics Engine as a host: the world continues in steps of a fixed length, and
// events are located by putting the body back and taking the step again, shorter.
//
//     hosts::OdeBody host({world, body}, t, 0.01);
//
// Steps taken again see the forces of the world (gravity, joints), not those that the program has
// added for one step.
#pragma once

#include <ode/ode.h>

#include <algorithm>
#include <array>

#include "ricochet/hosts/detail/body_step.hpp"

namespace ricochet::hosts {

/// A body in its world.
struct OdeEngine {
    dWorldID world;
    dBodyID body;
    int (*step)(dWorldID, dReal) = dWorldQuickStep;  ///< or dWorldStep

    /// State of the body that a repeated step starts from.
    struct Body {
        std::array<double, 6> x{};
        std::array<dReal, 4> attitude{};
        std::array<dReal, 3> spin{};
    };
    [[nodiscard]] Body read() const
    {
        Body at;
        std::copy_n(dBodyGetPosition(body), 3, at.x.begin());
        std::copy_n(dBodyGetLinearVel(body), 3, at.x.begin() + 3);
        std::copy_n(dBodyGetQuaternion(body), 4, at.attitude.begin());
        std::copy_n(dBodyGetAngularVel(body), 3, at.spin.begin());
        return at;
    }
    void write(const Body& at) const
    {
        dBodySetPosition(body, dReal(at.x[0]), dReal(at.x[1]), dReal(at.x[2]));
        dBodySetLinearVel(body, dReal(at.x[3]), dReal(at.x[4]), dReal(at.x[5]));
        dBodySetQuaternion(body, at.attitude.data());
        dBodySetAngularVel(body, at.spin[0], at.spin[1], at.spin[2]);
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
