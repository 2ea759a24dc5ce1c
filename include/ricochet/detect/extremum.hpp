// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/detect/extremum.hpp is now ricochet/extremum.hpp")

#include "ricochet/extremum.hpp"
