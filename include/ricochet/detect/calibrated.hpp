// Calibrated gates: checks deferred on the word of a network.
//
// Nothing else in the library skips a check without proof, so that it is asked for by name.
// What is skipped counts as `gated`; how often events are missed was measured, on runs, when the
// gate was trained (`Calibration` in its model). Outside the box of the model every step keeps
// its exact check, and is counted in `Statistics::outside_domain`.
//
//     Calibrated        a horizon gate. Of a guard of which nothing is known but its value or
//                       its sign. No check until the end of the longest horizon that is cleared,
//                       then one; if it finds the guard on its other side, the run returns to the
//                       event. An event is missed if, within a horizon, the guard goes through
//                       its surface and back, and the network did not see it coming.
//     CalibratedBounds  a level gate, of a guard with declared bounds: what `Planned` does, with
//                       the level that is cleared as a lower bound, asked before the guard
//                       is. Misses events only where that bound is wrong; where that is seen,
//                       the run ends as `Outcome::wrong_bound`.
//     Foreseen          a horizon gate as the forecast of `Planned`, and nothing more: it says
//                       when to look, exact values and declared bounds close every interval.
//                       Verified: with any weights the events are those of the exact detector, bit
//                       for bit.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>

#include "ricochet/detail/gate.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/planned.hpp"

namespace ricochet {

namespace detail {

/// @throws std::invalid_argument unless the gate is of the kind that is wanted.
void check_gate_kind(const gates::Gate& gate, bool horizon);
/// @throws std::invalid_argument: no step is kept.
void check_longest_stretch(std::size_t steps);

/// A detector with a gate to ask.
template <class Base>
class AsksGate : public Base {
public:
    [[nodiscard]] const gates::Gate& gate() const noexcept { return gate_; }

    /// Checks the system like `Gate::check`.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        gate_.check(system, x, smallest, largest);
    }

protected:
    /// @throws std::invalid_argument if the gate is of the other kind, or as `Base`.
    template <class... Arguments>
    AsksGate(gates::Gate gate, bool horizon, const Arguments&... arguments)
        : Base(arguments...), gate_(std::move(gate))
    {
        check_gate_kind(gate_, horizon);
    }

private:
    gates::Gate gate_;
};

}  // namespace detail

/// Defers checks while a calibrated gate predicts that no event is near: misses events at the rate
/// of its calibration, and needs no bounds. Backward runs check every step.
/// @tparam Exact  detector of the steps that are checked
template <class Exact = Extremum>
class Calibrated : public detail::AsksGate<detail::PutsOff<Exact>> {
    using Base = detail::AsksGate<detail::PutsOff<Exact>>;

public:
    static constexpr bool needs_bounds = false;
    static constexpr Evidence put_off = Evidence::gated;

    /// @param longest_stretch  steps without a check, at most; as many starts are kept
    /// @throws std::invalid_argument for a level gate, or if there is no interval.
    explicit Calibrated(gates::Gate gate, std::size_t longest_stretch = 256,
                        const Exact& exact = {})
        : Base(std::move(gate), true, exact), longest_(longest_stretch)
    {
        detail::check_longest_stretch(longest_);
    }

    [[nodiscard]] std::size_t longest() const noexcept { return longest_; }
    [[nodiscard]] static constexpr bool checks_bounds() noexcept { return false; }
    [[nodiscard]] static constexpr double margin() noexcept { return 0; }
    [[nodiscard]] static double sure(const GuardBound&, double) noexcept { return 0; }
    [[nodiscard]] static double hoped(const GuardBound&, double, double) noexcept { return 0; }
    [[nodiscard]] static bool closes(const GuardBound& from, const GuardBound& to, double,
                                     double band) noexcept
    {
        return from.distance > 0 && to.distance > band;
    }

    /// Time [s] without a check from here; a billionth longer than the horizon, which is a
    /// number of steps, so that rounding does not cut off the last of them.
    template <class System, class X>
    [[nodiscard]] gates::Gate::Answer horizon(const System& system, Mode mode, double t,
                                              const X& x) const
    {
        gates::Gate::Answer answer = this->gate().ask(system, mode, t, x);
        answer.cleared *= 1 + 1e-9;
        return answer;
    }

private:
    std::size_t longest_;
};

/// Uses the levels of a calibrated gate as lower bounds of the guard in the planner, beside the
/// bounds that the system declares: misses events at the rate of its calibration.
template <class Exact = Extremum>
class CalibratedBounds : public detail::AsksGate<Planned<Exact>> {
public:
    static constexpr Evidence put_off = Evidence::gated;

    /// @throws std::invalid_argument for a horizon gate, or as `Planned`.
    explicit CalibratedBounds(gates::Gate gate, const PlannerOptions& options = {},
                              const Exact& exact = {})
        : detail::AsksGate<Planned<Exact>>(std::move(gate), false, options, exact)
    {
    }

    /// The least that it ever clears.
    [[nodiscard]] double lowest_level() const noexcept
    {
        return this->gate().model().levels.front().value;
    }

    /// A value that no guard is seen to be below; 0: nothing is known.
    template <class System, class X>
    [[nodiscard]] gates::Gate::Answer level(const System& system, std::size_t /*which*/, Mode mode,
                                            double t, const X& x) const
    {
        return this->gate().ask(system, mode, t, x);
    }
};

/// Uses a horizon gate as a forecast of when a check is worth making; declared bounds close every
/// interval, so that the events are those of `Exact`, bit for bit, whatever the weights.
template <class Exact = Extremum>
class Foreseen : public detail::AsksGate<Planned<Exact>> {
public:
    static constexpr bool keeps_events = true;

    /// @throws std::invalid_argument for a level gate, or as `Planned`.
    explicit Foreseen(gates::Gate gate, const PlannerOptions& options = {}, const Exact& exact = {})
        : detail::AsksGate<Planned<Exact>>(std::move(gate), true, options, exact)
    {
    }

    /// When [s] to examine last.
    template <class System, class X>
    [[nodiscard]] gates::Gate::Answer horizon(const System& system, Mode mode, double t,
                                              const X& x) const
    {
        return this->gate().ask(system, mode, t, x);
    }
};

}  // namespace ricochet
