#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_SET_VALUED_OF(2, 1)
RICOCHET_HAND_OVER_OF(2, 1)
