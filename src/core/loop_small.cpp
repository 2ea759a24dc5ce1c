#include "core/instantiate.hpp"

RICOCHET_CORE(SmallState)
