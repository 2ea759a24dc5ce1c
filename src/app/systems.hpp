// `ricochet systems`: what can be simulated.
#pragma once

namespace ricochet::app {

/// Prints every system with its parameters.
int list_systems(bool json);

}  // namespace ricochet::app
