#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_MODES_OF(8, 4, )
RICOCHET_EVENTS_OF(8, 4, Dopri5, )
