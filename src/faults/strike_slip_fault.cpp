#include "ricochet/faults/strike_slip_fault.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "base/require.hpp"
#include "fault_kernel.hpp"

namespace ricochet {

namespace {

constexpr std::string_view who = "StrikeSlipFault";

void check(const StrikeSlipFault::Parameters& p)
{
    using namespace detail;
    require(p.elements >= 1, who, "elements", "be at least 1", p.elements);
    require_positive(who, "side", p.side);
    require_positive(who, "shear_modulus", p.shear_modulus);
    require(p.poisson >= 0 && p.poisson < 0.5, who, "poisson", "lie in [0, 0.5)", p.poisson);
    require_positive(who, "density", p.density);
    require_not_negative(who, "damping", p.damping);
    require_positive(who, "stress_gradient", p.stress_gradient);
    require_not_negative(who, "residual_friction", p.residual_friction);
    require_positive(who, "friction_drop", p.friction_drop);
    require_positive(who, "slip_distance", p.slip_distance);
    require_positive(who, "overload", p.overload);
    require_positive(who, "memory_limit", p.memory_limit);
    if (!p.kernel.empty() && p.mesh != FaultMesh::plain) {
        throw std::invalid_argument(fmt::format(
            "{}: a kernel file belongs to a plain mesh, not to a tip-corrected one", who));
    }
    const double needed = StrikeSlipFault::memory(p);
    if (needed > p.memory_limit) {
        constexpr double mib = 1048576;
        throw std::invalid_argument(fmt::format(
            "{0}: {1} x {1} elements need about {2:.0f} MiB, more than the limit of {3:.0f} "
            "MiB; take fewer elements or raise memory_limit",
            who, p.elements, needed / mib, p.memory_limit / mib));
    }
}

FaultStiffness full_space(const StrikeSlipFault::Parameters& p, double element)
{
    return FaultStiffness::toeplitz(p.elements, [&](int dx, int dz) {
        return -full_space_stress(dx * element, dz * element, element, element, p.poisson);
    });
}

/// Under a surface the stress at the centre of an element is not quite symmetric, as a mean over
/// the element would be: half the sum of both is taken.
FaultStiffness half_space(const StrikeSlipFault::Parameters& p, double element, double inset)
{
    const auto depth = [=](int row) { return inset + (row + 0.5) * element; };
    return FaultStiffness::layered(p.elements, [&](int dx, int row, int other) {
        const double a = depth(row);
        const double b = depth(other);
        const double x = dx * element;
        return -0.5 * (half_space_stress(x, a, b, element, element, p.poisson) +
                       half_space_stress(x, b, a, element, element, p.poisson));
    });
}

FaultStiffness from_file(const StrikeSlipFault::Parameters& p)
{
    Eigen::MatrixXd kernel = read_kernel(p.kernel);
    try {
        if (kernel.diagonal().maxCoeff() >= 0) {
            throw std::invalid_argument(fmt::format(
                "the kernel must be negative definite, stress that slip adds: slip unloads its own "
                "element, but there is a {} on the diagonal",
                kernel.diagonal().maxCoeff()));
        }
        constexpr double metres = 1000;  // in a km
        kernel *= -p.side / metres;
        return FaultStiffness::dense(p.elements, std::move(kernel));
    } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(fmt::format("{}: {}", p.kernel.string(), error.what()));
    }
}

}  // namespace

double StrikeSlipFault::memory(const Parameters& p) noexcept
{
    if (!p.kernel.empty()) return dense_memory(p.elements);
    return p.medium == FaultMedium::half_space ? layered_memory(p.elements)
                                               : toeplitz_memory(p.elements);
}

StrikeSlipFault::StrikeSlipFault(const Parameters& parameters) : p_(parameters)
{
    check(p_);
    const bool plain = p_.mesh == FaultMesh::plain;
    element_ = plain ? 1.0 / p_.elements : 1 / (p_.elements + 0.5);
    inset_ = plain ? 0 : 0.25 * element_;
    share_ = element_ * element_;
    time_unit_ = p_.side * std::sqrt(p_.density / p_.shear_modulus);

    const Eigen::Index n = p_.elements;
    weight_.resize(n * n);
    for (int row = 0; row < p_.elements; ++row) {
        const double stress = p_.stress_gradient * depth(row);
        weight_.segment(row * n, n)
            .setConstant(stress * p_.side / (p_.shear_modulus * p_.slip_distance));
    }
    const FaultStiffness raw = !p_.kernel.empty() ? from_file(p_)
                               : p_.medium == FaultMedium::full_space
                                   ? full_space(p_, element_)
                                   : half_space(p_, element_, inset_);
    factor_ = mean(raw.solve(weight_)) / weight_.mean();
    stiffness_ = raw.scaled(factor_);
}

double StrikeSlipFault::depth(int row) const noexcept
{
    return p_.side * (inset_ + (row + 0.5) * element_);
}

double StrikeSlipFault::strength(Eigen::Index which, double path) const
{
    return weight_[which] * (p_.residual_friction + p_.friction_drop * std::exp(-path));
}

double StrikeSlipFault::weakening(Eigen::Index which, double path) const
{
    return -weight_[which] * p_.friction_drop * std::expm1(-path);
}

}  // namespace ricochet
