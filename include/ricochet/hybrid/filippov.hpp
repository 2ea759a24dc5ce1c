// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/hybrid/filippov.hpp is now ricochet/filippov.hpp")

#include "ricochet/filippov.hpp"
