// The solvers of the random inclusions, which have sizes of their own, are compiled once.
#pragma once

#include "ricochet/nonsmooth/hand_over.hpp"

// clang 14 would instantiate members whose constraints these sizes do not satisfy.
#ifndef __clang__
RICOCHET_INCLUSIONS_OF(6, 4, extern)
RICOCHET_SET_VALUED_OF(6, 5, extern)
RICOCHET_HAND_OVER_OF(6, 5, extern)
#endif
