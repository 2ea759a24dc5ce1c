// The energy of a fault's run, from the results of the run.
//
// In nondimensional form, with the slip d, the velocity v and the initial stress tau, the motion
//
//     v' = tau - K u - H u' - friction,      u = d - v_pl t,
//
// multiplied by v and integrated, gives the balance of energy: the work of the initial stress and
// of the plates, which move at v_pl, is stored as motion and strain, or lost to friction and
// radiation:
//
//     tau.d - v_pl 1.(int K u + H u' dt) = v.v / 2 + u.K u / 2 + int friction.v dt + int u'.H u' dt
//
// K and its root are matrices here, and friction is integrated from the motion alone, and
// not taken from the sums of the integrator.
#pragma once

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "faults/stiffness_series.hpp"
#include "ricochet/faults/friction.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::test {

struct FaultEnergy {
    double work = 0;       ///< of the load
    double kinetic = 0;    ///< gained
    double strain = 0;     ///< gained
    double friction = 0;   ///< dissipated
    double radiation = 0;  ///< dissipated

    /// The missing energy relative to the largest of the terms.
    [[nodiscard]] double defect() const
    {
        return std::abs(work - kinetic - strain - friction - radiation) /
               std::max({std::abs(work), std::abs(strain), friction});
    }
};

/// K and H as matrices.
struct FaultMatrices {
    explicit FaultMatrices(const StrikeSlipFault& fault) : k(fault.size(), fault.size())
    {
        StiffnessProduct product(fault.stiffness());
        for (Eigen::Index i = 0; i < fault.size(); ++i) {
            const Eigen::VectorXd unit = Eigen::VectorXd::Unit(fault.size(), i);
            product(unit.data(), k.col(i).data());
        }
        h = 2 * fault.parameters().damping *
            Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(k).operatorSqrt();
    }
    Eigen::MatrixXd k, h;
};

/// Energy with friction that weakens with slip, whose work is a function of the path; radiated
/// energy is given.
inline FaultEnergy weakening_energy(const StrikeSlipFault& fault, const FaultMatrices& m,
                                    const Eigen::VectorXd& slip, const Eigen::VectorXd& velocity,
                                    double radiation)
{
    const auto& p = fault.parameters();
    const Eigen::VectorXd d = slip / fault.slip_unit();
    const Eigen::VectorXd v = velocity / fault.velocity_unit();
    FaultEnergy out{
        .kinetic = v.squaredNorm() / 2, .strain = d.dot(m.k * d) / 2, .radiation = radiation};
    for (Eigen::Index i = 0; i < d.size(); ++i) {
        const double weight = fault.weight()[i];
        const double strength = weight * (p.residual_friction + p.friction_drop);
        out.work += (1 + p.overload) * strength * d[i];
        out.friction += weight * (p.residual_friction * d[i] - p.friction_drop * std::expm1(-d[i]));
    }
    return out;
}

/// Energy of the explicit run, with its radiation by Simpson's rule over 2 `pairs` even intervals.
inline FaultEnergy explicit_energy(const StrikeSlipFault& fault, RuptureOptions options,
                                   std::size_t pairs)
{
    const FaultMatrices m(fault);
    const double spacing = options.t_end / static_cast<double>(2 * pairs);
    for (std::size_t i = 0; i <= 2 * pairs; ++i) {
        options.snapshot_times.push_back(i == 2 * pairs ? options.t_end
                                                        : spacing * static_cast<double>(i));
    }
    const Rupture run = simulate(fault, options);
    double radiation = 0;
    for (std::size_t i = 0; i < run.snapshots.size(); ++i) {
        const Eigen::VectorXd v = run.snapshots[i].velocity / fault.velocity_unit();
        const double weight = i == 0 || i == 2 * pairs ? 1 : i % 2 == 1 ? 4 : 2;
        radiation += weight / 3 * spacing / fault.time_unit() * v.dot(m.h * v);
    }
    return weakening_energy(fault, m, run.slip, run.velocity, radiation);
}

/// Energy of Bathe's steps, with its radiation by Simpson's rule over each of them.
inline FaultEnergy bathe_energy(const StrikeSlipFault& fault, const RuptureOptions& options,
                                BatheOptions bathe)
{
    const FaultMatrices m(fault);
    double radiation = 0;
    bathe.observer = [&](const BatheStep& step) {
        const auto& [a, b, c] = step.velocity;
        radiation += step.h / 6 * (a->dot(m.h * *a) + 4 * b->dot(m.h * *b) + c->dot(m.h * *c));
    };
    const Rupture run = simulate(fault, options, bathe);
    return weakening_energy(fault, m, run.slip, run.velocity, radiation);
}

/// Energy with rate-and-state friction and the ageing law: theta from the velocities by its own
/// equation, integrals by the trapezoidal rule over the steps.
inline FaultEnergy rate_state_energy(const StrikeSlipFault& fault, RuptureOptions options,
                                     const FaultFriction& friction, const RateStateOptions& how)
{
    const FaultMatrices m(fault);
    options.snapshot_times = simulate(fault, options, friction, how).step_times;
    const RateStateRupture run = simulate(fault, options, friction, how);
    const auto& p = fault.parameters();
    const AgeingLaw<> law(friction.law);
    const double plate = friction.plate_velocity / fault.velocity_unit();
    const double xi = friction.theta ? law.xi_of_theta(*friction.theta)
                                     : law.steady_state(std::abs(friction.slip_rate));
    Eigen::VectorXd normal = fault.weight();
    if (friction.normal_stress > 0) {
        normal.setConstant(friction.normal_stress * p.side / (p.shear_modulus * p.slip_distance));
    }
    const Eigen::VectorXd tau =
        (1 + friction.overload) * law.friction(friction.slip_rate, xi) * normal;
    Eigen::VectorXd theta = Eigen::VectorXd::Constant(
        fault.size(), std::exp(xi) * friction.law.d_rs / friction.law.v_star);
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(fault.size());
    const Eigen::VectorXd k_ones = m.k * ones;

    FaultEnergy out;
    double before[3] = {0, 0, 0};  // powers of friction, radiation and the plates
    double first_kinetic = 0;
    const auto& pictures = run.rupture.snapshots;
    for (std::size_t n = 0; n < pictures.size(); ++n) {
        const double t = pictures[n].t / fault.time_unit();
        const Eigen::VectorXd d = pictures[n].slip / fault.slip_unit();
        const Eigen::VectorXd v = pictures[n].velocity / fault.velocity_unit();
        const Eigen::VectorXd u = d - plate * t * ones;
        const Eigen::VectorXd rate = v - plate * ones;
        const double seconds = n == 0 ? 0 : pictures[n].t - pictures[n - 1].t;
        if (n > 0) {
            // theta' = 1 - V theta / D_RS with the mean V that the slip gives.
            const Eigen::VectorXd slip = pictures[n].slip - pictures[n - 1].slip;
            for (Eigen::Index i = 0; i < theta.size(); ++i) {
                const double x = slip[i] / friction.law.d_rs;
                const double gain = x == 0 ? 1 : -std::expm1(-x) / x;
                theta[i] = theta[i] * std::exp(-x) + seconds * gain;
            }
        }
        double power[3] = {0, rate.dot(m.h * rate), plate * (k_ones.dot(u) + ones.dot(m.h * rate))};
        for (Eigen::Index i = 0; i < theta.size(); ++i) {
            power[0] +=
                normal[i] * law.friction(pictures[n].velocity[i], law.xi_of_theta(theta[i])) * v[i];
        }
        double* sums[3] = {&out.friction, &out.radiation, &out.work};
        const double h = seconds / fault.time_unit();
        for (int k = 0; k < 3; ++k) {
            *sums[k] += (k == 2 ? -h : h) / 2 * (before[k] + power[k]);
            before[k] = power[k];
        }
        if (n == 0) first_kinetic = v.squaredNorm() / 2;
        out.kinetic = v.squaredNorm() / 2 - first_kinetic;
        if (n + 1 == pictures.size()) {
            out.strain = u.dot(m.k * u) / 2;
            out.work += tau.dot(d);
        }
    }
    return out;
}

}  // namespace ricochet::test
