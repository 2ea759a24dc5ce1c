// Deprecated: this path is dropped after the next release.
#pragma once

#pragma message("ricochet/detect/step_probe.hpp is now ricochet/step_probe.hpp")

#include "ricochet/step_probe.hpp"
