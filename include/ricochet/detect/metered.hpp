// A network that is asked only while that pays.
//
//     integrate(system, x0, options, FixedStep<Rk4>{}, Metered(Foreseen(gate)));
//
// For gates that cannot change what is found (`Verified`, `Foreseen`, `Certified`): events are
// the same, bit for bit, whether the network is asked or not. How often it is asked depends on
// the clock, and so differs from run to run; `MeterOptions::decision` fixes it.
#pragma once

#include <concepts>
#include <utility>

#include "ricochet/detail/meter.hpp"

namespace ricochet {

/// A gate under which the events are those of its exact detector, whatever the network says (or,
/// of a certificate, whether it is asked or not).
template <class Detector>
concept KeepsEvents = requires
{
    requires Detector::keeps_events;
};

/// Detector that asks its network only while that saves time, measured on the run itself; the
/// events are those of `Detector`.
template <KeepsEvents Detector>
class Metered : public Detector {
public:
    /// @throws std::invalid_argument if a cost is negative, `trials` outside of [0, 1] or `piece`
    /// 0.
    explicit Metered(Detector detector, const MeterOptions& options = {})
        : Detector(std::move(detector)), options_(options)
    {
        detail::validate(options);
    }

    [[nodiscard]] const MeterOptions& metering() const noexcept { return options_; }

private:
    MeterOptions options_;
};

}  // namespace ricochet
