#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_SET_VALUED_OF(8, 4)
RICOCHET_HAND_OVER_OF(8, 4)
