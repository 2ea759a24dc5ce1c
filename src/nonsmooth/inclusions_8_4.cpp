// The phases of a run are in phases_8_4.cpp: both together take 1.3 GB to compile.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_SET_VALUED_OF(8, 4)
