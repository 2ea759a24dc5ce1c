// The verified gate: a network may change what a run costs, never what it finds.
//
// The network proposes which exact checks to defer, and every interval is closed
// by an exact check that covers all of it. What covers an interval longer than one
// step is a bound on the guard's rate; without a declared bound no interval can be
// covered, and every step keeps its exact check. The network is then evaluated without
// gain, and the statistics show it: no checks deferred, and how often it would have
// been right. With any weights whatever the events are those of the exact detector,
// bit for bit.
#pragma once

#include <utility>

#include "ricochet/detail/around.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/network.hpp"

namespace ricochet {

/// Detector that counts how often a network predicts what `Exact` finds, and defers checks where
/// the guard declares bounds. The events are those of `Exact`, bit for bit, whatever the weights.
template <class Exact = Extremum>
class Verified : public detail::Around<Exact> {
public:
    static constexpr bool checks_every_step = true;
    static constexpr bool keeps_events = true;

    /// Takes the network that predicts and the detector that decides.
    explicit Verified(Network network, const Exact& exact = {})
        : detail::Around<Exact>(exact), network_(std::move(network))
    {
    }

    /// Checks the system like `Network::check`.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        network_.check(system, x, smallest, largest);
    }

    /// Prediction of the network for the step, for the statistics.
    template <class Guard, class Step>
    [[nodiscard]] bool clears(const Guard& guard, const Step& step) const noexcept
    {
        return network_.clears(guard, step);
    }

private:
    Network network_;
};

}  // namespace ricochet
