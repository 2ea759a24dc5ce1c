#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_SET_VALUED_OF(Eigen::Dynamic, Eigen::Dynamic)
RICOCHET_HAND_OVER_OF(Eigen::Dynamic, Eigen::Dynamic)
