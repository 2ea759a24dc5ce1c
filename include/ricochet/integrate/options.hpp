// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/integrate/options.hpp is now ricochet/options.hpp")

#include "ricochet/options.hpp"
