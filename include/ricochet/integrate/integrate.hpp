// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/integrate/integrate.hpp is now ricochet/integrate.hpp")

#include "ricochet/integrate.hpp"
