// Events of a rigid body of Bullet.
#include "ricochet/hosts/bullet.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

#include "hosts/engine_cases.hpp"

namespace ricochet::hosts_test::bullet_test {

namespace {

/// A world without bodies, and what Bullet makes one of.
struct EmptyWorld {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
};

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

    EmptyWorld parts_;
    btDiscreteDynamicsWorld& world_ = parts_.world;
    btSphereShape shape_{btScalar(0.1)};
    btRigidBody body_{btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape_, {1, 1, 1})};
    btRigidBody beside_{btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape_, {1, 1, 1})};
};

INSTANTIATE_TYPED_TEST_SUITE_P(Bullet, InEngine, BulletWorld);

/// A body without weight between two walls, 4 cm apart; at 2.5 s its velocity is set.
struct Slit {
    using State = FallingBody::State;
    static constexpr std::size_t guard_count = 2;
    double start_again = std::numeric_limits<double>::infinity();  ///< [s]

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        dxdt = {x[3], x[4], x[5], 0, 0, 0};
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const X& x) const
    {
        return which == 0 ? 0.02 - x[0] : x[0] + 0.02;
    }
    void reset(std::size_t /*which*/, double /*t*/, State& x) const { x[3] = -x[3]; }
    [[nodiscard]] double next_time_event(double t) const
    {
        return t < start_again ? start_again : std::numeric_limits<double>::infinity();
    }
    void time_reset(double /*t*/, State& x) const { x[3] = 0.5; }
};

/// Two bodies without weight, of which Bullet puts slow ones to sleep.
struct SlowBodies : EmptyWorld {
    btSphereShape shape{btScalar(0.1)};
    btRigidBody body{btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape)};
    btRigidBody beside{btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape)};

    explicit SlowBodies(double velocity)
    {
        world.setGravity({0, 0, 0});
        world.addRigidBody(&body);
        world.addRigidBody(&beside);
        body.setLinearVelocity({btScalar(velocity), 0, 0});
        beside.setCenterOfMassTransform(btTransform(btQuaternion::getIdentity(), {0, 10, 0}));
        beside.setLinearVelocity({btScalar(0.5), 0, 0});
    }
    SlowBodies(const SlowBodies&) = delete;
    SlowBodies& operator=(const SlowBodies&) = delete;
    ~SlowBodies()
    {
        world.removeRigidBody(&beside);
        world.removeRigidBody(&body);
    }
    /// Moves to t = 4 s, through the events of `slit`; returns their number.
    std::size_t run(const Slit& slit)
    {
        hosts::BulletBody host({&world, &body}, 0, 0.01);
        EventMonitor monitor(slit, Slit::State{});
        EXPECT_EQ(hosts::run(host, monitor, 4), Verdict::stands);
        return monitor.events().size();
    }
};

TEST(Bullet, ABodyFallsAsleepAfterAsLongAsWithoutEvents)
{
    // Bullet stops bodies that have been slower than 0.8 m/s for two seconds.
    SlowBodies alone(1);
    for (int i = 0; i < 400; ++i) alone.world.stepSimulation(btScalar(0.01), 0);
    ASSERT_NEAR(alone.beside.getCenterOfMassPosition().x(), 1, 0.02);
    SlowBodies bodies(1);
    EXPECT_GT(bodies.run({}), 90u);
    EXPECT_NEAR(bodies.beside.getCenterOfMassPosition().x(),
                alone.beside.getCenterOfMassPosition().x(), 0.02);
}

TEST(Bullet, ABodyThatIsSetInMotionIsAwake)
{
    SlowBodies bodies(0);
    EXPECT_GT(bodies.run({.start_again = 2.5}), 10u);
    EXPECT_EQ(std::fabs(bodies.body.getLinearVelocity().x()), 0.5);
}

}  // namespace

}  // namespace ricochet::hosts_test::bullet_test
