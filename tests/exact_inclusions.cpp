// Solvers of five reactions, a size that the library has not, compiled once for all tests.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_INCLUSIONS_OF(6, 5, )
