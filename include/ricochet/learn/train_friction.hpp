// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/learn/train_friction.hpp is now ricochet/learn_steps/train_friction.hpp")

#include "ricochet/learn_steps/train_friction.hpp"
