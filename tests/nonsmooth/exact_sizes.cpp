// Solvers of two components and two reactions; see exact_inclusions.cpp.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_SET_VALUED_OF(2, 2)
RICOCHET_HAND_OVER_OF(2, 2)
