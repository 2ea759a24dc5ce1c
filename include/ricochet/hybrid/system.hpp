// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/hybrid/system.hpp is now ricochet/system.hpp")

#include "ricochet/system.hpp"
