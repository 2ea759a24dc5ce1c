// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/integrate/methods.hpp is now ricochet/methods.hpp")

#include "ricochet/methods.hpp"
