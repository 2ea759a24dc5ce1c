#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_INCLUSIONS_OF(2, 1, )
