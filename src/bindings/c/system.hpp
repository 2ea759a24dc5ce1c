// The handle of a system.
#pragma once

#include <memory>

#include "bindings/c/callback_system.hpp"
#include "bindings/c/handles.hpp"

struct rc_system : ricochet::c::Handle {
    explicit rc_system(const rc_callbacks& callbacks)
        : Handle(ricochet::c::Kind::system),
          system(std::make_shared<const ricochet::c::CallbackSystem>(callbacks))
    {
    }

    std::shared_ptr<const ricochet::c::CallbackSystem> system;
};
