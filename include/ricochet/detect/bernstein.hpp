// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/detect/bernstein.hpp is now ricochet/bernstein.hpp")

#include "ricochet/bernstein.hpp"
