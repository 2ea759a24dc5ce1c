// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/hybrid/times.hpp is now ricochet/times.hpp")

#include "ricochet/times.hpp"
