#include "inclusions_of_six.hpp"

#ifndef __clang__
RICOCHET_INCLUSIONS_OF(6, 4, )
RICOCHET_SET_VALUED_OF(6, 5, )
RICOCHET_HAND_OVER_OF(6, 5, )
#endif
