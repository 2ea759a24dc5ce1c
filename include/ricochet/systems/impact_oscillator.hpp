// A forced oscillator that hits a wall.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <vector>

#include "ricochet/guard.hpp"

namespace ricochet {

struct SystemDescriptor;

/// A damped linear oscillator under a harmonic force, with a rigid wall on one side.
///
/// State x = (position u, velocity v), dimensionless.
///
///     flow    u' = v,  v' = cos(frequency t) - u - damping v
///     guard   wall - u, falling; it bounds the motion
///     reset   u⁺ = wall,  v⁺ = -restitution v⁻
///
/// (S. W. Shaw and P. J. Holmes, A periodically forced piecewise linear oscillator,
/// Journal of Sound and Vibration 90, 1983, pages 129 to 155, whose wall is the limit of
/// an ever stiffer spring.)
///
/// Known solution: between impacts the motion is the sum of a forced and a damped free
/// oscillation in closed form, and `impacts` follows it from rest. Functions are generic
/// in the state and its scalar.
class ImpactOscillator {
public:
    using State = std::array<double, 2>;

    struct Parameters {
        double frequency = 0.7;    ///< of the force, in units of the oscillator's own, positive
        double wall = 1;           ///< position, positive
        double restitution = 0.8;  ///< Newton's coefficient, in [0, 1]
        double damping = 0.1;      ///< twice Lehr's damping ratio, in (0, 2)
    };

    constexpr ImpactOscillator() = default;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit ImpactOscillator(const Parameters& parameters);

    static constexpr std::string_view name = "impact-oscillator";
    /// Names, units, ranges and what is known; see descriptor.hpp.
    [[nodiscard]] static const SystemDescriptor& descriptor();
    static constexpr State start{0, 0};

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "wall", .unilateral = true};
    }

    template <class X>
    constexpr void flow(const ScalarOf<X>& t, const X& x, X& dxdt) const noexcept
    {
        using std::cos;
        dxdt[0] = x[1];
        dxdt[1] = cos(p_.frequency * t) - x[0] - p_.damping * x[1];
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        return p_.wall - x[0];
    }

    template <class X>
    constexpr void reset(const ScalarOf<X>& /*t*/, X& x) const noexcept
    {
        x[0] = p_.wall;
        x[1] *= -p_.restitution;
    }

    /// One period of the force [s].
    [[nodiscard]] double period() const noexcept;

    /// Times [s] of all impacts from `start` at time 0 up to `t_end`: the closed form of
    /// each flight in long double, searched in steps of a 128th of the faster of the two
    /// oscillations, in which the acceleration is taken to change its sign once at most. The times
    /// end early where flights become shorter than 1e-9 s, or lower than a hundred roundings of
    /// the displacement, as before the mass comes to rest at the wall.
    [[nodiscard]] std::vector<double> impacts(double t_end) const;

private:
    Parameters p_{};
};

}  // namespace ricochet
