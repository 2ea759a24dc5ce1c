// The solvers of the random inclusions of five reactions, and the steps of systems that tests look
// into, which the library has not, are compiled once.
#pragma once

#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_INCLUSIONS_OF(6, 5, extern)
RICOCHET_STEPS_OF(2, 2, extern)
RICOCHET_STEPS_OF(6, 4, extern)
