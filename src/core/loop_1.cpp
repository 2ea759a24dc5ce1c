#include "core/instantiate.hpp"

RICOCHET_CORE(std::array<double, 1>)
