// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/hybrid/stop.hpp is now ricochet/stop.hpp")

#include "ricochet/stop.hpp"
