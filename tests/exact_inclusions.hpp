// The solvers of the random inclusions of five reactions, which the library has not, are compiled
// once.
#pragma once

#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_INCLUSIONS_OF(6, 5, extern)
