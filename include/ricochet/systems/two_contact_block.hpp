// A block on the ground, which it touches at two corners with friction.
#pragma once

#include <Eigen/Dense>

#include <string_view>

namespace ricochet {

/// A block with q = (x, height z of the centre above its height at rest, tilt), for small tilts.
///
/// Pushed at speed v0 it slides for the time v0 / (friction g) over v0^2 / (2 friction g), and
/// rests with its weight shifted to the front corner:
///
///     m g (1/2 +- friction half_height / (2 half_width)),
///
/// as long as friction < half_width / half_height; beyond that it tips.
struct TwoContactBlock {
    static constexpr std::string_view name = "two-contact-block";
    static constexpr int coordinates = 3;
    static constexpr int contacts = 2;
    static constexpr int tangents = 1;
    using Vector = Eigen::Vector3d;

    double mass_of_block = 2;   ///< [kg]
    double half_width = 0.5;    ///< [m]
    double half_height = 0.25;  ///< [m]
    double gravity = 9.81;      ///< [m/s^2]
    double coefficient = 0.4;   ///< of friction
    double bounce = 0;          ///< restitution

    void mass(const Vector& /*q*/, Eigen::Matrix3d& m) const
    {
        const double inertia =
            mass_of_block / 3 * (half_width * half_width + half_height * half_height);
        m = Eigen::Vector3d(mass_of_block, mass_of_block, inertia).asDiagonal();
    }
    void force(double /*t*/, const Vector& /*q*/, const Vector& /*v*/, Vector& f) const
    {
        f << 0, -mass_of_block * gravity, 0;
    }
    void gaps(const Vector& q, Eigen::Vector2d& g) const  // rear corner, front corner
    {
        g << q[1] - half_width * q[2], q[1] + half_width * q[2];
    }
    void directions(const Vector& /*q*/, Eigen::Matrix<double, 4, 3>& h) const
    {
        h << 0, 1, -half_width,  //
            1, 0, half_height,   //
            0, 1, half_width,    //
            1, 0, half_height;
    }
    [[nodiscard]] double restitution(int /*contact*/) const { return bounce; }
    [[nodiscard]] double friction(int /*contact*/) const { return coefficient; }
};

}  // namespace ricochet
