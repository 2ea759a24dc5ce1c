// Internal: the declarations of this header may change without notice.
//
// The sleep of a body of Bullet.
#pragma once

#include <btBulletDynamicsCommon.h>

namespace ricochet::hosts::detail {

/// Whether a body has been put to sleep, and for how long it has been slow.
struct BulletRest {
    int state = ACTIVE_TAG;
    btScalar slow_for = 0;  ///< [s]

    explicit BulletRest(const btRigidBody& of)
        : state(of.getActivationState()), slow_for(of.getDeactivationTime())
    {
    }
    void write(btRigidBody& to) const
    {
        // A body that a reset sets in motion is awake.
        const bool moves = !to.getLinearVelocity().isZero() || !to.getAngularVelocity().isZero();
        const bool wakes = moves && state == ISLAND_SLEEPING;
        to.forceActivationState(wakes ? ACTIVE_TAG : state);
        to.setDeactivationTime(wakes ? 0 : slow_for);
    }
};

}  // namespace ricochet::hosts::detail
