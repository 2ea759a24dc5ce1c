// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message( \
    "ricochet/taylor.hpp is now ricochet/taylor/taylor.hpp, of ricochet::taylor, which is to be linked")

#include "ricochet/taylor/taylor.hpp"
