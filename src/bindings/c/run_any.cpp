#include "bindings/c/run_of.hpp"

RICOCHET_C_RUN(any, 0)
