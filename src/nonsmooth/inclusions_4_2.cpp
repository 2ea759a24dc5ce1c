#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_SET_VALUED_OF(4, 2)
RICOCHET_HAND_OVER_OF(4, 2)
