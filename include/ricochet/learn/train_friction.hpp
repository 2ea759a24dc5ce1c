// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message( \
    "ricochet/learn/train_friction.hpp is now ricochet/learn_steps/train_friction.hpp, of ricochet::learn_steps, which is to be linked")

#include "ricochet/learn_steps/train_friction.hpp"
