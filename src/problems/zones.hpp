// A point among hundreds of rotating zones: many guards on one state.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "ricochet/guard.hpp"

namespace ricochet {

/// A point on two springs sweeps over a field of rotating, flower-shaped zones. Entering or leaving
/// a zone is recorded, and changes nothing.
///
/// State x = (position p [m], velocity v [m/s]), two components each.
///
///     flow    p' = v,  v' = -(w0² p0, w1² p1),  w = frequency (1, golden ratio)
///     guard i r - R_i (1 + a_i s cos(m_i (angle - turn_i t))),  either direction;
///             r and angle of p - centre_i,  s = 2 r² / (r² + R_i²)
///
/// The factor s is 1 near the edge and makes the guard smooth at the centre of the flower.
///
/// *Bounds.* In the radial direction the guard changes by at most 1 + a R |s'(r)| <= 1 + 1.3 a (the
/// largest value of R s' is 3 sqrt(3) / 4), across by a m R s / r <= a m, and with time by R a m
/// |turn| s, at most twice R a m |turn|, which is counted as path of the point. The energies of
/// both springs are conserved and bound speed and acceleration in both directions of time. With s <
/// 2 the zone lies within a disc of radius R (1 + 2 a).
///
/// Functions are generic in the state type.
class Zones {
public:
    using State = std::array<double, 4>;
    static constexpr bool resets = false;

    struct Parameters {
        std::size_t count = 256;  ///< of zones, positive
        std::uint64_t seed = 1;   ///< of their places and shapes
        double size = 5;          ///< [m] zones lie within a square of twice this side
        double frequency = 0.5;   ///< [rad/s] of the slower spring, positive
        double turn = 1;          ///< [rad/s] largest angular velocity of a zone
    };

    Zones() : Zones(Parameters{}) {}

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit Zones(const Parameters& parameters);

    static constexpr std::string_view name = "zones";

    /// In a corner of the field, at rest: the path fills the whole square.
    [[nodiscard]] State start() const noexcept { return {size_, size_, 0, 0}; }

    [[nodiscard]] std::size_t guard_count() const noexcept { return zones_->size(); }
    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "zone", .crossing = Crossing::either, .resets = false};
    }

    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -stiffness_[0] * x[0];
        dxdt[3] = -stiffness_[1] * x[1];
    }

    template <class X>
    [[nodiscard]] double guard(std::size_t which, double t, const X& x) const noexcept
    {
        return value((*zones_)[which], t, x[0], x[1]);
    }

    template <class X>
    void guards(double t, const X& x, std::span<double> g) const noexcept
    {
        for (std::size_t i = 0; i < g.size(); ++i) g[i] = value((*zones_)[i], t, x[0], x[1]);
    }

    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double t, const X& x,
                                    const D& dxdt) const noexcept
    {
        return rate((*zones_)[which], t, {x[0], x[1], dxdt[0], dxdt[1]});
    }

    [[nodiscard]] double lipschitz(std::size_t which) const noexcept
    {
        return (*zones_)[which].lipschitz;
    }

    template <class X>
    [[nodiscard]] double speed_bound(std::size_t which, double /*t*/, const X& x) const noexcept
    {
        return std::sqrt(x[2] * x[2] + x[3] * x[3]) + (*zones_)[which].turning;
    }

    /// Bound of |v'|: w1 times the largest speed that the energies allow, times 1 + 1e-7,
    /// since errors of the integration change the energies.
    template <class X>
    [[nodiscard]] double acceleration_bound(std::size_t /*which*/, double /*t*/,
                                            const X& x) const noexcept
    {
        const double first = stiffness_[0] * (stiffness_[0] * x[0] * x[0] + x[2] * x[2]);
        const double second = stiffness_[1] * (stiffness_[1] * x[1] * x[1] + x[3] * x[3]);
        return (1 + 1e-7) * std::sqrt(first + second);
    }

    /// The distance to the disc around the zone, in 2 ns.
    template <class X>
    [[nodiscard]] double lower_bound(std::size_t which, double /*t*/, const X& x) const noexcept
    {
        const Zone& zone = (*zones_)[which];
        const double dx = x[0] - zone.x;
        const double dy = x[1] - zone.y;
        return std::sqrt(dx * dx + dy * dy) - zone.disc;
    }

private:
    struct Zone {
        double x, y;       ///< [m] centre
        double radius;     ///< [m]
        double amplitude;  ///< a
        int petals;        ///< m
        double turn;       ///< [rad/s]
        double lipschitz;
        double turning;  ///< [m/s] its change with time, counted as path
        double disc;     ///< [m] R (1 + 2 a)
    };

    [[nodiscard]] static double value(const Zone& zone, double t, double x, double y) noexcept;
    [[nodiscard]] static double rate(const Zone& zone, double t,
                                     const std::array<double, 4>& motion) noexcept;

    double size_;
    std::array<double, 2> stiffness_{};  ///< [1/s²]
    std::shared_ptr<const std::vector<Zone>> zones_;
};

}  // namespace ricochet
