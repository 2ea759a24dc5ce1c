// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/detect/gates.hpp is now ricochet/gates.hpp")

#include "ricochet/gates.hpp"
