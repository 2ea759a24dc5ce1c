// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message( \
    "ricochet/lanes.hpp is now ricochet/taylor/lanes.hpp, of ricochet::taylor, which is to be linked")

#include "ricochet/taylor/lanes.hpp"
