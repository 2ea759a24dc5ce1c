#include "bindings/c/run_of.hpp"

RICOCHET_C_RUN(1, 1)
