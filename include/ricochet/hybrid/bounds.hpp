// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/hybrid/bounds.hpp is now ricochet/bounds.hpp")

#include "ricochet/bounds.hpp"
