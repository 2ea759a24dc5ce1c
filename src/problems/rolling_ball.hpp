// A ball that slides, rolls and comes to rest on a moving plate.
#pragma once

#include <cmath>
#include <string_view>

#include "ricochet/nonsmooth/inclusion.hpp"

namespace ricochet {

/// A solid ball on a level plate that moves at s(t) = plate_speed cos(plate_frequency t), with
/// Coulomb's friction where they touch and a resistance against rolling.
///
/// State w = (v [m/s], spin [rad/s]); spin > 0 rolls towards v > 0. The force F and the torque M:
///
///     mass v'       = F,               |F| <= friction mass g      against v - radius spin - s
///     inertia spin' = -radius F + M,   |M| <= resistance mass g    against spin
///
/// with inertia = 2/5 mass radius^2. The ball rolls while F is held; while M is held as well it
/// rests on the plate, which is possible as long as |s'| <= resistance g / radius.
///
/// Known solution on a plate of constant speed, from spin 0 and faster than the plate by u:
/// it slides until `rolling_time`, and rests on the plate from `rest_time` on.
class RollingBall {
public:
    struct Parameters {
        double mass = 0.2;           ///< [kg], positive
        double radius = 0.05;        ///< [m], positive
        double friction = 0.3;       ///< coefficient, zero or positive
        double resistance = 0.001;   ///< lever arm of the normal force [m], zero or positive
        double plate_speed = 0.1;    ///< [m/s]
        double plate_frequency = 0;  ///< [rad/s], zero or positive
        double gravity = 9.81;       ///< [m/s^2], positive
    };

    RollingBall() = default;
    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit RollingBall(const Parameters& parameters);

    static constexpr std::string_view name = "rolling-ball";
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 2;
    static constexpr bool affine = true;
    using Vector = Eigen::Vector2d;

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }
    [[nodiscard]] double inertia() const noexcept { return 0.4 * p_.mass * p_.radius * p_.radius; }

    void smooth(double /*t*/, const Vector& /*w*/, Vector& f) const { f.setZero(); }
    void smooth_jacobian(double /*t*/, const Vector& /*w*/, Eigen::Matrix2d& j) const
    {
        j.setZero();
    }
    void mass(Eigen::Matrix2d& a) const { a << p_.mass, 0, 0, inertia(); }
    void observe(Eigen::Matrix2d& e) const { e << 1, -p_.radius, 0, 1; }
    void offset(double t, Vector& s) const
    {
        s << p_.plate_speed * std::cos(p_.plate_frequency * t), 0;
    }
    void offset_rate(double t, Vector& s) const
    {
        s << -p_.plate_speed * p_.plate_frequency * std::sin(p_.plate_frequency * t), 0;
    }
    [[nodiscard]] sets::Box<2> reaction_set(double /*t*/, const Vector& /*w*/) const
    {
        const double weight = p_.mass * p_.gravity;
        const double force = p_.friction * weight;
        const double torque = p_.resistance * weight;
        return sets::Box<2>({-force, -torque}, {force, torque});
    }

    /// Time [s] at which the ball begins to roll, for a start with spin 0 that is faster than the
    /// plate by `faster` > 0 [m/s], for friction radius > resistance.
    [[nodiscard]] double rolling_time(double faster) const noexcept
    {
        return faster /
               (3.5 * p_.friction * p_.gravity - 2.5 * p_.resistance * p_.gravity / p_.radius);
    }

    /// Time [s] at which the ball comes to rest on the plate after the same start.
    [[nodiscard]] double rest_time(double faster) const noexcept
    {
        const double t = rolling_time(faster);
        const double left = faster - p_.friction * p_.gravity * t;
        return t + 1.4 * left * p_.radius / (p_.resistance * p_.gravity);
    }

private:
    Parameters p_;
};

}  // namespace ricochet
