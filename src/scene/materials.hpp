// Validation of materials.
#pragma once

#include <string>

#include "ricochet/scene/scene.hpp"

namespace ricochet::detail {

/// @throws std::invalid_argument in a sentence that begins with `label`
void check_coefficients(double restitution, double friction, const SpeedLaw& law,
                        const std::string& label);

[[nodiscard]] inline bool depends_on_speed(const SpeedLaw& law) noexcept
{
    return !std::holds_alternative<std::monostate>(law);
}

}  // namespace ricochet::detail
