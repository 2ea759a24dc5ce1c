// The woodpecker toy: a bird on a spring that climbs down a pole by impacts and jamming.
#pragma once

#include <Eigen/Dense>

#include <string_view>

namespace ricochet {

/// A sleeve with play on a pole, and a woodpecker on a torsional spring fixed to it.
///
/// q = (height y of the sleeve [m], its angle [rad], the bird's angle [rad]); contacts: the
/// beak, the lower edge of the sleeve, its upper edge, each with friction on the pole. Small
/// angles. From the start it settles on a cycle: the sleeve jams, the bird swings, the
/// beak hits, the sleeve slides a little, and so on.
///
/// (F. Pfeiffer, Mechanische Systeme mit unstetigen Übergängen, Ingenieur-Archiv 54, 1984;
/// model and parameters of C. Glocker and C. Studer, Formulation and preparation for
/// numerical evaluation of linear complementarity systems in dynamics, Multibody System
/// Dynamics 13, 2005.)
struct Woodpecker {
    static constexpr std::string_view name = "woodpecker";
    static constexpr int coordinates = 3;
    static constexpr int contacts = 3;
    static constexpr int tangents = 1;
    using Vector = Eigen::Vector3d;

    double sleeve_mass = 3e-4;      ///< [kg]
    double sleeve_inertia = 5e-9;   ///< [kg m^2]
    double bird_mass = 4.5e-3;      ///< [kg]
    double bird_inertia = 7e-7;     ///< [kg m^2]
    double spring = 5.6e-3;         ///< [N m]
    double gravity = 9.81;          ///< [m/s^2]
    double pole_radius = 2.5e-3;    ///< [m]
    double sleeve_radius = 3.1e-3;  ///< [m]
    double sleeve_half = 5.8e-3;    ///< half its height [m]
    double sleeve_arm = 0.010;      ///< pole to spring [m]
    double bird_arm = 0.015;        ///< spring to the bird's centre [m]
    double beak_height = 0.02;      ///< [m]
    double beak_reach = 0.0201;     ///< [m]
    double coefficient = 0.3;       ///< of friction, at all contacts
    double beak_restitution = 0.5;

    /// State with the sleeve's lower edge on the pole; at the source's angle of -0.1036 it would be
    /// a micrometre inside.
    [[nodiscard]] static Vector start() { return {0, -0.0006 / 0.0058 * (1 - 1e-12), -0.2788}; }
    [[nodiscard]] static Vector start_velocity() { return {-0.3411, 0, -7.4583}; }

    void mass(const Vector& /*q*/, Eigen::Matrix3d& m) const
    {
        const double a = sleeve_arm;
        const double b = bird_arm;
        m << sleeve_mass + bird_mass, bird_mass * a, bird_mass * b,  //
            bird_mass * a, sleeve_inertia + bird_mass * a * a, bird_mass * a * b, bird_mass * b,
            bird_mass * a * b, bird_inertia + bird_mass * b * b;
    }
    void force(double /*t*/, const Vector& q, const Vector& /*v*/, Vector& f) const
    {
        const double torque = spring * (q[1] - q[2]);
        f << -(sleeve_mass + bird_mass) * gravity, -torque - bird_mass * gravity * sleeve_arm,
            torque - bird_mass * gravity * bird_arm;
    }
    void gaps(const Vector& q, Vector& g) const
    {
        g << sleeve_arm + bird_arm - beak_reach - pole_radius - beak_height * q[2],
            sleeve_radius - pole_radius + sleeve_half * q[1],
            sleeve_radius - pole_radius - sleeve_half * q[1];
    }
    void directions(const Vector& /*q*/, Eigen::Matrix<double, 6, 3>& h) const
    {
        h << 0, 0, -beak_height,                   //
            1, sleeve_arm, bird_arm - beak_reach,  //
            0, sleeve_half, 0,                     //
            1, sleeve_radius, 0,                   //
            0, -sleeve_half, 0,                    //
            1, sleeve_radius, 0;
    }
    [[nodiscard]] double restitution(int contact) const
    {
        return contact == 0 ? beak_restitution : 0;
    }
    [[nodiscard]] double friction(int /*contact*/) const { return coefficient; }
};

}  // namespace ricochet
