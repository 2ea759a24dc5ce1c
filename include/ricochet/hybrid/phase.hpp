// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/hybrid/phase.hpp is now ricochet/phase.hpp")

#include "ricochet/phase.hpp"
