// The phases of a run are in phases_4_2.cpp: both together take 1.2 GB to compile.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_SET_VALUED_OF(4, 2)
