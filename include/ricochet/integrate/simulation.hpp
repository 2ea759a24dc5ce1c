// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/integrate/simulation.hpp is now ricochet/simulation.hpp")

#include "ricochet/simulation.hpp"
