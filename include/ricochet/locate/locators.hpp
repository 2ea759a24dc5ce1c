// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/locate/locators.hpp is now ricochet/locators.hpp")

#include "ricochet/locators.hpp"
