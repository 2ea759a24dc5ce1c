#include "bindings/c/run_of.hpp"

template class ricochet::c::CallbackSetup<std::vector<double>>;

RICOCHET_C_RUN(any, 0)
