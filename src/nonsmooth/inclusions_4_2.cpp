#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_SET_VALUED_OF(4, 2, )
RICOCHET_HAND_OVER_OF(4, 2, )
RICOCHET_MODES_OF(4, 2, )
RICOCHET_EVENTS_OF(4, 2, Dopri5, )
