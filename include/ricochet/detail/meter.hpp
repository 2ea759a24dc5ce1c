// Internal: the declarations of this header may change without notice.
//
// Detectors whose networks are metered: see src/core/cost_comparison.hpp.
#pragma once

#include "ricochet/meter_options.hpp"

namespace ricochet::detail {

/// A detector whose network is metered.
template <class Detector>
concept Metering = requires(const Detector& detector)
{
    detector.metering();
};

/// @throws std::invalid_argument naming the option.
void validate(const MeterOptions& options);

}  // namespace ricochet::detail
