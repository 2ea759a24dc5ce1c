#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_SET_VALUED_OF(1, 1, )
RICOCHET_HAND_OVER_OF(1, 1, )
RICOCHET_MODES_OF(1, 1, )
RICOCHET_EVENTS_OF(1, 1, Dopri5, )
