#include "ricochet/nonsmooth/contact_motion.hpp"

RICOCHET_TIME_STEPPING_OF(2, )
RICOCHET_CONTACT_MOTION_OF(2, )
