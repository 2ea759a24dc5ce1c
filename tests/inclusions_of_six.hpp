// The solvers of the random inclusions, which have sizes of their own, are compiled once.
#pragma once

#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_INCLUSIONS_OF(6, 4, extern)
RICOCHET_SET_VALUED_OF(6, 5, extern)
RICOCHET_HAND_OVER_OF(6, 5, extern)
