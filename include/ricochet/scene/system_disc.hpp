// A disc whose motion a system determines.
#pragma once

#include "ricochet/scene/scene.hpp"

namespace ricochet {

/// A disc of a system, as its state places it.
struct SystemDisc {
    Vector2 at{};        ///< [m] centre
    Vector2 velocity{};  ///< [m/s]
};

}  // namespace ricochet
