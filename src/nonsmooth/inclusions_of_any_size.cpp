#include "ricochet/nonsmooth/set_valued_motion.hpp"

RICOCHET_SET_VALUED_OF(Eigen::Dynamic, Eigen::Dynamic, )
