// Solvers of five reactions, a size that the library has not, for the long tests: each of these
// takes a minute to compile. Their phases are in exact_phases.cpp, since both together take 1.3 GB.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_INCLUSIONS_OF(6, 5, extern)
RICOCHET_SET_VALUED_OF(6, 5)
