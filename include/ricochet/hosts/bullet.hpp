// A rigid body of Bullet as a host: the world continues in steps of a fixed length, and events are
// located by putting the body back and taking the step again, shorter.
//
//     hosts::BulletBody host({&world, &body}, t, 0.01);
//
// Bullet computes in single precision unless it is built otherwise, and events are located to the
// same precision. A repeated step moves the whole world, whose other bodies are put back with this
// one. Repeated steps include gravity, but not the forces that the program has applied for one
// step.
#pragma once

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <array>
#include <vector>

#include "ricochet/hosts/detail/body_step.hpp"
#include "ricochet/hosts/detail/bullet_rest.hpp"

// Bullet writes vectors as floats and copies them as SSE vectors. Where writing and reading are
// inlined into one function, g++ 12 at -O2 assumes that they concern different memory, and the
// value that is read has not been rounded to float (with -fno-strict-aliasing it has).
#ifdef __GNUC__
#define RICOCHET_NOT_INLINED [[gnu::noinline]]
#else
#define RICOCHET_NOT_INLINED
#endif

namespace ricochet::hosts {

/// A body in its world.
struct BulletEngine {
    btDynamicsWorld* world;
    btRigidBody* body;

    /// Motion of another body of the world.
    struct Other {
        btRigidBody* body;
        btTransform place;
        btVector3 velocity, spin;
        detail::BulletRest rest;
    };
    /// State of the world that a repeated step starts from.
    struct Body {
        std::array<double, 6> x;
        btTransform place;
        btVector3 spin;
        detail::BulletRest rest;
        std::vector<Other> others{};
    };
    [[nodiscard]] RICOCHET_NOT_INLINED Body read() const
    {
        const btVector3 place = body->getCenterOfMassPosition();
        const btVector3 velocity = body->getLinearVelocity();
        Body at{{place.x(), place.y(), place.z(), velocity.x(), velocity.y(), velocity.z()},
                body->getWorldTransform(),
                body->getAngularVelocity(),
                detail::BulletRest(*body)};
        const auto& all = world->getCollisionObjectArray();
        for (int i = 0; i < all.size(); ++i) {
            btRigidBody* const other = btRigidBody::upcast(all[i]);
            if (!other || other == body || other->isStaticOrKinematicObject()) continue;
            at.others.push_back({other, other->getWorldTransform(), other->getLinearVelocity(),
                                 other->getAngularVelocity(), detail::BulletRest(*other)});
        }
        return at;
    }
    RICOCHET_NOT_INLINED void write(Body at) const
    {
        at.place.setOrigin({btScalar(at.x[0]), btScalar(at.x[1]), btScalar(at.x[2])});
        body->setCenterOfMassTransform(at.place);
        body->setLinearVelocity({btScalar(at.x[3]), btScalar(at.x[4]), btScalar(at.x[5])});
        body->setAngularVelocity(at.spin);
        at.rest.write(*body);
        for (const Other& other : at.others) {
            other.body->setCenterOfMassTransform(other.place);
            other.body->setLinearVelocity(other.velocity);
            other.body->setAngularVelocity(other.spin);
            other.rest.write(*other.body);
        }
    }
    void advance(double s) const { world->stepSimulation(btScalar(s), 0); }
    [[nodiscard]] double gravity(std::size_t i) const
    {
        const btVector3 all = body->getGravity();
        return i == 0 ? all.x() : i == 1 ? all.y() : all.z();
    }
};

/// x = (position [m], velocity [m/s]) of the body's centre of mass. The rotation goes with it.
using BulletBody = detail::BodyStep<BulletEngine>;

}  // namespace ricochet::hosts

#undef RICOCHET_NOT_INLINED
