// A mass on a spring that rubs on a belt, with slipping and sticking as modes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <type_traits>

#include "ricochet/guard.hpp"

namespace ricochet {

/// The automaton behind `CoulombOscillator` and `StickSlip`.
///
/// State x = (position u [m], velocity v [m/s]) of the mass; b is the speed of the belt
/// and R(s) = friction / (1 + weakening s) the kinetic friction at the sliding speed s.
///
///     flow    slip-left  (v < b):  u' = v,  mass v' = -stiffness u + R(b - v)
///             slip-right (v > b):  u' = v,  mass v' = -stiffness u - R(v - b)
///             stick:               u' = b,  v' = 0
///     guard   stop, while slipping: b - v or v - b, the one that is positive; falling
///             pulled-left, while sticking: static_friction - stiffness u; falling
///             pulled-right, while sticking: static_friction + stiffness u; falling
///     reset   stop: v⁺ = b; on to stick where the static friction holds the spring,
///             else to slip in the direction of the spring's pull
///             pulled-*: u⁺ = +-static_friction / stiffness, v⁺ = b; on to slip-*
///
/// The stages of a step may lie beyond s = 0: there R is continued smoothly until it has
/// doubled, and is constant beyond.
///
/// At the onset of slip with static_friction = friction the guard `stop` has a double zero:
/// its rate is zero too, and the second derivative, stiffness |b| / mass, is positive
/// since the sign of the guard follows the direction of slip. The exact u⁺ keeps rounding from
/// giving the rate a sign of its own. Functions are generic in the state and
/// its scalar.
class FrictionOscillator {
public:
    using State = std::array<double, 2>;

    enum : Mode { slip_left, slip_right, stick };
    enum : std::size_t { stop, pulled_left, pulled_right };  // the guards

    struct Parameters {
        double mass = 1;             ///< [kg], positive
        double stiffness = 1;        ///< [N/m], positive
        double belt_speed = 0;       ///< [m/s]
        double friction = 1;         ///< [N] at sliding speed 0, zero or positive
        double static_friction = 1;  ///< [N] largest force while sticking, at least `friction`
        double weakening = 0;        ///< [s/m], zero or positive
    };

    constexpr FrictionOscillator() = default;

    /// @throws std::invalid_argument if a parameter is outside its range.
    /// `self` is the name of the system in the message.
    explicit FrictionOscillator(const Parameters& parameters,
                                std::string_view self = "FrictionOscillator");

    static constexpr std::size_t guard_count = 3;
    static constexpr std::size_t mode_count = 3;

    [[nodiscard]] static constexpr std::string_view mode_name(Mode mode) noexcept
    {
        return mode == slip_left ? "slip-left" : mode == slip_right ? "slip-right" : "stick";
    }

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t which) noexcept
    {
        return {.name = which == stop          ? "stop"
                        : which == pulled_left ? "pulled-left"
                                               : "pulled-right"};
    }

    [[nodiscard]] static constexpr bool enabled(std::size_t which, Mode mode) noexcept
    {
        return (which == stop) == (mode != stick);
    }

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        const ScalarOf<X> sliding = x[1] - p_.belt_speed;
        dxdt[0] = mode == stick ? ScalarOf<X>(p_.belt_speed) : x[1];
        switch (mode) {
            case slip_left: dxdt[1] = (spring(x[0]) + kinetic(-sliding)) / p_.mass; return;
            case slip_right: dxdt[1] = (spring(x[0]) - kinetic(sliding)) / p_.mass; return;
            default: dxdt[1] = 0; return;
        }
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(std::size_t which, Mode mode,
                                              const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        switch (which) {
            case pulled_left: return p_.static_friction + spring(x[0]);
            case pulled_right: return p_.static_friction - spring(x[0]);
            default: return mode == slip_left ? p_.belt_speed - x[1] : x[1] - p_.belt_speed;
        }
    }

    /// The mode of the motion at (u, v): at the speed of the belt, stick where the static
    /// friction holds the spring, else slip in the direction of the spring's pull.
    [[nodiscard]] Mode mode_at(double u, double v) const noexcept;

    template <class X>
    [[nodiscard]] Mode reset(std::size_t which, Mode /*mode*/, double /*t*/, X& x) const noexcept
    {
        x[1] = p_.belt_speed;
        switch (which) {
            case pulled_left: x[0] = p_.static_friction / p_.stiffness; return slip_left;
            case pulled_right: x[0] = -p_.static_friction / p_.stiffness; return slip_right;
            default: return mode_at(x[0], x[1]);
        }
    }

protected:
    struct Unchecked {};
    /// With parameters that are known to lie in their ranges.
    constexpr FrictionOscillator(const Parameters& parameters, Unchecked /*are*/) noexcept
        : p_(parameters)
    {
    }

private:
    /// Force of the spring [N], to the right.
    template <class S>
    [[nodiscard]] constexpr S spring(const S& u) const noexcept
    {
        return -p_.stiffness * u;
    }

    template <class S>
    [[nodiscard]] constexpr S kinetic(const S& sliding) const noexcept
    {
        const S softening = 1 + p_.weakening * sliding;
        // Stages use numbers; derivatives and power series are taken at states of the motion.
        if constexpr (std::is_same_v<S, double>) return p_.friction / std::max(softening, 0.5);
        return p_.friction / softening;
    }

    Parameters p_{};
};

}  // namespace ricochet
