// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/integrate/run.hpp is now ricochet/run.hpp")

#include "ricochet/run.hpp"
