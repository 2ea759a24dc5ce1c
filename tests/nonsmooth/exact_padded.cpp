// As exact_sizes.cpp, of five components and three reactions.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_SET_VALUED_OF(5, 3)
RICOCHET_HAND_OVER_OF(5, 3)
