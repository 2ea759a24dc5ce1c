// Calibrated gates: checks put off on the word of a network.
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
//                       when to look, exact values and declared bounds close every stretch.
//                       Verified: with any weights the events are those of the exact detector, bit
//                       for bit.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>

#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/gate.hpp"
#include "ricochet/detect/planned.hpp"

namespace ricochet {

namespace detail {

/// @throws std::invalid_argument unless the gate is of the kind that is wanted.
void check_gate_kind(const Gate& gate, bool horizon);
/// @throws std::invalid_argument: no step is kept.
void check_longest_stretch(std::size_t steps);

}  // namespace detail

template <class Exact = Extremum>
class Calibrated : public detail::PutsOff<Exact> {
public:
    static constexpr bool needs_bounds = false;
    static constexpr Evidence put_off = Evidence::gated;

    /// @param longest_stretch  steps without a check, at most; as many starts are kept
    /// @throws std::invalid_argument for a level gate, or if there is no stretch.
    explicit Calibrated(Gate gate, std::size_t longest_stretch = 256, const Exact& exact = {})
        : detail::PutsOff<Exact>(exact), gate_(std::move(gate)), longest_(longest_stretch)
    {
        detail::check_gate_kind(gate_, true);
        detail::check_longest_stretch(longest_);
    }

    [[nodiscard]] const Gate& gate() const noexcept { return gate_; }

    /// As `Gate::check`.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        gate_.check(system, x, smallest, largest);
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
    [[nodiscard]] Gate::Answer horizon(const System& system, Mode mode, double t, const X& x) const
    {
        Gate::Answer answer = gate_.ask(system, mode, t, x);
        answer.cleared *= 1 + 1e-9;
        return answer;
    }

private:
    Gate gate_;
    std::size_t longest_;
};

template <class Exact = Extremum>
class CalibratedBounds : public Planned<Exact> {
public:
    static constexpr Evidence put_off = Evidence::gated;

    /// @throws std::invalid_argument for a horizon gate, or as `Planned`.
    explicit CalibratedBounds(Gate gate, const PlannerOptions& options = {},
                              const Exact& exact = {})
        : Planned<Exact>(options, exact), gate_(std::move(gate))
    {
        detail::check_gate_kind(gate_, false);
    }

    [[nodiscard]] const Gate& gate() const noexcept { return gate_; }

    /// As `Gate::check`.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        gate_.check(system, x, smallest, largest);
    }

    /// A value that the guard is not seen to be below; 0: nothing is known.
    template <class System, class X>
    [[nodiscard]] Gate::Answer level(const System& system, Mode mode, double t, const X& x) const
    {
        return gate_.ask(system, mode, t, x);
    }

private:
    Gate gate_;
};

template <class Exact = Extremum>
class Foreseen : public Planned<Exact> {
public:
    /// @throws std::invalid_argument for a level gate, or as `Planned`.
    explicit Foreseen(Gate gate, const PlannerOptions& options = {}, const Exact& exact = {})
        : Planned<Exact>(options, exact), gate_(std::move(gate))
    {
        detail::check_gate_kind(gate_, true);
    }

    [[nodiscard]] const Gate& gate() const noexcept { return gate_; }

    /// As `Gate::check`.
    template <class System, class X>
    void check(const System& system, const X& x, double smallest, double largest) const
    {
        gate_.check(system, x, smallest, largest);
    }

    /// When [s] to look at last.
    template <class System, class X>
    [[nodiscard]] Gate::Answer horizon(const System& system, Mode mode, double t, const X& x) const
    {
        return gate_.ask(system, mode, t, x);
    }

private:
    Gate gate_;
};

}  // namespace ricochet
