// Events of a rigid body of Bullet.
#include "ricochet/hosts/bullet.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "hosts/engine_cases.hpp"

namespace ricochet::hosts_test::bullet_test {

namespace {

/// A world with a body that falls.
class BulletWorld {
public:
    explicit BulletWorld(const FallingBody::State& x0)
    {
        world_.setGravity({0, 0, btScalar(-FallingBody::gravity)});
        world_.addRigidBody(&body_);
        body_.setActivationState(DISABLE_DEACTIVATION);
        move_to(x0[0], x0[1], x0[2]);
        body_.setLinearVelocity({btScalar(x0[3]), btScalar(x0[4]), btScalar(x0[5])});
        body_.setAngularVelocity({1, 2, 3});
    }
    BulletWorld(const BulletWorld&) = delete;
    BulletWorld& operator=(const BulletWorld&) = delete;
    ~BulletWorld()
    {
        world_.removeRigidBody(&beside_);
        world_.removeRigidBody(&body_);
    }

    [[nodiscard]] hosts::BulletBody host(double length) { return {{&world_, &body_}, 0, length}; }
    void move_up() { move_to(0, 0, 5); }
    /// A body that falls beside the first.
    void add_beside(double x)
    {
        world_.addRigidBody(&beside_);
        beside_.setActivationState(DISABLE_DEACTIVATION);
        btTransform place = beside_.getWorldTransform();
        place.setOrigin({btScalar(x), 0, 10});
        beside_.setCenterOfMassTransform(place);
    }
    [[nodiscard]] double velocity_beside() const { return beside_.getLinearVelocity().z(); }

    /// Rounding of ten metres in single precision.
    static constexpr double rounding = sizeof(btScalar) == 4 ? 2e-6 : 1e-12;

private:
    void move_to(double x, double y, double z)
    {
        btTransform place = body_.getWorldTransform();
        place.setOrigin({btScalar(x), btScalar(y), btScalar(z)});
        body_.setCenterOfMassTransform(place);
    }

    btDefaultCollisionConfiguration configuration_;
    btCollisionDispatcher dispatcher_{&configuration_};
    btDbvtBroadphase broadphase_;
    btSequentialImpulseConstraintSolver solver_;
    btDiscreteDynamicsWorld world_{&dispatcher_, &broadphase_, &solver_, &configuration_};
    btSphereShape shape_{btScalar(0.1)};
    btRigidBody body_{btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape_, {1, 1, 1})};
    btRigidBody beside_{btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape_, {1, 1, 1})};
};

INSTANTIATE_TYPED_TEST_SUITE_P(Bullet, InEngine, BulletWorld);

}  // namespace

}  // namespace ricochet::hosts_test::bullet_test
