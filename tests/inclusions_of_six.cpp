#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_INCLUSIONS_OF(6, 5, )
