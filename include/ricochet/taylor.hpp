// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/taylor.hpp is now ricochet/taylor/taylor.hpp")

#include "ricochet/taylor/taylor.hpp"
