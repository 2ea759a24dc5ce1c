// The right-hand side of a fault, nondimensional.
#pragma once

#include <cmath>

#include "ricochet/faults/strike_slip_fault.hpp"
#include "stiffness_series.hpp"

namespace ricochet::detail {

/// sigma of each element with rate-and-state friction, nondimensional.
[[nodiscard]] inline Eigen::VectorXd normal_forces(const StrikeSlipFault& fault,
                                                   const FaultFriction& friction)
{
    if (friction.normal_stress == 0) return fault.weight();
    const auto& p = fault.parameters();
    return Eigen::VectorXd::Constant(
        fault.size(), friction.normal_stress * p.side / (p.shear_modulus * p.slip_distance));
}

/// Products with K and H, with scratch memory of their own.
class FaultForces {
public:
    FaultForces(const StrikeSlipFault& fault, double bound)
        : fault_(fault),
          product_(fault.stiffness()),
          spectrum_(fault.stiffness().spectrum()),
          root_(StiffnessSeries::within(root, spectrum_, bound)),
          bound_(root_.relative_error(root)),
          kd_(fault.size()),
          hv_(fault.size())
    {
    }

    /// Force that drives each element beyond b(0): overload b(0) - K d - H v.
    void drive(const Eigen::VectorXd& d, const Eigen::VectorXd& v, Eigen::VectorXd& out)
    {
        ++evaluations_;
        product_(d, kd_);
        root_.apply(product_, v, hv_, scratch_);
        const auto& p = fault_.parameters();
        const double start = p.overload * (p.residual_friction + p.friction_drop);
        out = start * fault_.weight() - kd_ - 2 * p.damping * hv_;
    }

    /// b(0), nondimensional.
    [[nodiscard]] double first_strength(Eigen::Index i) const
    {
        const auto& p = fault_.parameters();
        return fault_.weight()[i] * (p.residual_friction + p.friction_drop);
    }

    [[nodiscard]] StiffnessProduct& product() noexcept { return product_; }
    [[nodiscard]] const detail::Spectrum& spectrum() const noexcept { return spectrum_; }
    [[nodiscard]] const StiffnessSeries& root_of_stiffness() const noexcept { return root_; }
    [[nodiscard]] double bound() const noexcept { return bound_; }
    [[nodiscard]] std::uint64_t evaluations() const noexcept { return evaluations_; }

    static double root(double eigenvalue) { return std::sqrt(eigenvalue); }

private:
    const StrikeSlipFault& fault_;
    StiffnessProduct product_;
    detail::Spectrum spectrum_;
    StiffnessSeries root_;
    double bound_;
    Eigen::VectorXd kd_, hv_;
    StiffnessSeries::Scratch scratch_;
    std::uint64_t evaluations_ = 0;
};

}  // namespace ricochet::detail
