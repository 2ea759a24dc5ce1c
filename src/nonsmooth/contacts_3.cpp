#include "ricochet/nonsmooth/contact_motion.hpp"

RICOCHET_TIME_STEPPING_OF(3, )
RICOCHET_CONTACT_MOTION_OF(3, )
