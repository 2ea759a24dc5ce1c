// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/hybrid/guard.hpp is now ricochet/guard.hpp")

#include "ricochet/guard.hpp"
