#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_SET_VALUED_OF(8, 4, )
RICOCHET_HAND_OVER_OF(8, 4, )
