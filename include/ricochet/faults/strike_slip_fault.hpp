// A vertical strike-slip fault that slips in an earthquake.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string_view>

#include "ricochet/detail/fault_stiffness.hpp"

namespace ricochet {

/// Medium around the fault.
enum class FaultMedium {
    full_space,  ///< elastic, without bounds: K depends on distances alone
    half_space,  ///< under a free surface at depth 0, which the fault reaches
};

/// How the square is cut into elements.
enum class FaultMesh {
    plain,  ///< n x n elements of side L / n
    /// n x n elements of side L / (n + 1/2), a quarter of an element away from every edge: the
    /// slip goes to zero there like a square root, and the error of the mesh falls faster.
    tip_corrected,
};

/// A square fault of n x n elements, each with one slip along the strike, under Coulomb friction
/// that weakens with slip (D. M. Riley and others, Reinforcement Learning-based adaptive
/// time-integration for nonsmooth dynamics, section 5.3).
///
/// With slip d from the start, its path s, velocity v and mean density of mass rho L,
///
///     d' = v,   s' = |v|
///     rho L v' = -G/L K d - H v + tau - r,    r in b(s) Sign(v)
///     b = (residual + drop exp(-s / slip_distance)) sigma,    H = 2 zeta sqrt(rho G K)
///
/// sigma, the effective normal stress, grows with depth; the stress at the start, tau = (1 +
/// overload) b(0), exceeds the strength everywhere by a hair. K is that of the medium times
/// L and a factor that makes the mean slip under a uniform drop of friction that of a spring of
/// stiffness G / L: for one element, K = 1.
///
/// From an unstable rest the time of the rupture depends on the overload: each decade moves its
/// peak by 1.6 s (side 3 km).
///
/// Here everything is nondimensional: slip in slip_distance, time in `time_unit`, hence
///
///     v' = overload b(0) + b(0) - b(s) - K d - H v   where v > 0,   H = 2 zeta sqrt(K).
class StrikeSlipFault {
public:
    struct Parameters {
        int elements = 1;                ///< n, per side, positive
        double side = 3000;              ///< L [m], positive
        double shear_modulus = 30e9;     ///< G [Pa], positive
        double poisson = 0.25;           ///< in [0, 0.5)
        double density = 2500;           ///< rho [kg/m^3], positive
        double damping = 0.8 / 3;        ///< zeta, zero or positive
        double stress_gradient = 15e3;   ///< of sigma [Pa/m], positive
        double residual_friction = 0.5;  ///< zero or positive
        double friction_drop = 0.1;      ///< positive
        double slip_distance = 0.1;      ///< [m], positive
        double overload = 1e-5;          ///< positive
        FaultMedium medium = FaultMedium::full_space;
        FaultMesh mesh = FaultMesh::plain;
        /// Stresses for slip, n^2 x n^2 [1/km] as a .npy file, symmetric and negative definite,
        /// instead of those of the medium; its mesh is plain.
        std::filesystem::path kernel{};
        double memory_limit = 1073741824;  ///< [bytes], positive
    };

    /// @throws std::invalid_argument for a parameter out of range, a mesh that needs more
    /// memory than the limit, or a kernel that does not fit.
    explicit StrikeSlipFault(const Parameters& parameters);
    StrikeSlipFault() : StrikeSlipFault(Parameters{}) {}

    static constexpr std::string_view name = "fault";

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }
    [[nodiscard]] int elements() const noexcept { return p_.elements; }
    [[nodiscard]] Eigen::Index size() const noexcept { return weight_.size(); }
    [[nodiscard]] const FaultStiffness& stiffness() const noexcept { return *stiffness_; }
    [[nodiscard]] double factor() const noexcept { return factor_; }

    [[nodiscard]] double time_unit() const noexcept { return time_unit_; }  ///< L sqrt(rho/G) [s]
    [[nodiscard]] double slip_unit() const noexcept { return p_.slip_distance; }  ///< [m]
    [[nodiscard]] double velocity_unit() const noexcept { return slip_unit() / time_unit_; }
    /// Share of an element in the square.
    [[nodiscard]] double share() const noexcept { return share_; }
    /// Mean over the square of a field on the elements, zero elsewhere.
    [[nodiscard]] double mean(const Eigen::VectorXd& field) const { return share_ * field.sum(); }
    /// Depth [m] of the centres of row `row`.
    [[nodiscard]] double depth(int row) const noexcept;

    /// sigma L / (G slip_distance) of each element.
    [[nodiscard]] const Eigen::VectorXd& weight() const noexcept { return weight_; }
    /// b(s) of an element, nondimensional.
    [[nodiscard]] double strength(Eigen::Index which, double path) const;
    /// b(0) - b(s) of an element.
    [[nodiscard]] double weakening(Eigen::Index which, double path) const;

    /// Memory [bytes] that these parameters need with a run, before anything is made.
    [[nodiscard]] static double memory(const Parameters& parameters) noexcept;

private:
    Parameters p_;
    std::optional<FaultStiffness> stiffness_;
    double factor_ = 1;
    double time_unit_ = 1;
    double share_ = 1;
    double element_ = 1;  // side of an element over L
    double inset_ = 0;    // its distance from the edge, over L
    Eigen::VectorXd weight_;
};

}  // namespace ricochet
