// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message( \
    "ricochet/learn/step_control.hpp is now ricochet/learn_steps/step_control.hpp, of ricochet::learn_steps, which is to be linked")

#include "ricochet/learn_steps/step_control.hpp"
