#include "ricochet/nonsmooth/hand_over.hpp"

RICOCHET_INCLUSIONS_OF(3, 1, )
