// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/detect/planned.hpp is now ricochet/planned.hpp")

#include "ricochet/planned.hpp"
