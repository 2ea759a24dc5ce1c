#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_DOPRI5_OF(8, 4)
