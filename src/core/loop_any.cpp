#include "core/instantiate.hpp"

RICOCHET_CORE(std::vector<double>)
