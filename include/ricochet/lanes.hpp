// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/lanes.hpp is now ricochet/taylor/lanes.hpp")

#include "ricochet/taylor/lanes.hpp"
