// The verified gate: a network may change what a run costs, never what it finds.
//
// The network proposes which exact checks to put off, and every stretch is closed
// by an exact check that covers all of it. What covers a stretch longer than one
// step is a bound on the guard's rate; a guard that declares none gives nothing to
// cover with, and every step keeps its exact check. The network is then asked in
// vain, and the statistics say so: no checks put off, and how often it would have
// been right. With any weights whatever the events are those of the exact detector,
// bit for bit.
#pragma once

#include <utility>

#include "ricochet/detail/around.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/network.hpp"

namespace ricochet {

template <class Exact = Extremum>
class Verified : public detail::Around<Exact> {
public:
    static constexpr bool checks_every_step = true;
    static constexpr bool keeps_events = true;

    explicit Verified(Network network, const Exact& exact = {})
        : detail::Around<Exact>(exact), network_(std::move(network))
    {
    }

    /// As `Network::check`.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        network_.check(system, x, smallest, largest);
    }

    /// What the network predicts of the step, for the statistics.
    template <class Guard, class Step>
    [[nodiscard]] bool clears(const Guard& guard, const Step& step) const noexcept
    {
        return network_.clears(guard, step);
    }

private:
    Network network_;
};

}  // namespace ricochet
