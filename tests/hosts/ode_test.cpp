// Events of a body of the Open Dynamics Engine.
#include "ricochet/hosts/ode.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "hosts/engine_cases.hpp"

namespace ricochet::hosts_test::ode_test {

namespace {

/// A world with a body that falls.
class OdeWorld {
public:
    explicit OdeWorld(const FallingBody::State& x0)
    {
        dInitODE2(0);
        world_ = dWorldCreate();
        dWorldSetGravity(world_, 0, 0, -FallingBody::gravity);
        body_ = dBodyCreate(world_);
        dBodySetPosition(body_, x0[0], x0[1], x0[2]);
        dBodySetLinearVel(body_, x0[3], x0[4], x0[5]);
        dBodySetAngularVel(body_, 1, 2, 3);
    }
    OdeWorld(const OdeWorld&) = delete;
    OdeWorld& operator=(const OdeWorld&) = delete;
    ~OdeWorld()
    {
        dWorldDestroy(world_);
        dCloseODE();
    }
    [[nodiscard]] hosts::OdeBody host(double length) const
    {
        return {{world_, body_, dWorldQuickStep, others_}, 0, length};
    }
    /// A body that falls beside the first.
    void add_beside(double x)
    {
        others_.push_back(dBodyCreate(world_));
        dBodySetPosition(others_.back(), x, 0, 10);
    }
    [[nodiscard]] double velocity_beside() const { return dBodyGetLinearVel(others_.back())[2]; }
    void move_up() const { dBodySetPosition(body_, 0, 0, 5); }

    static constexpr double rounding = 1e-12;

private:
    dWorldID world_;
    dBodyID body_;
    std::vector<dBodyID> others_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(Ode, InEngine, OdeWorld);

}  // namespace

}  // namespace ricochet::hosts_test::ode_test
