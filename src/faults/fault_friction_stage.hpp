// One implicit stage of a fault whose elements have rate-and-state friction.
//
// A stage of length g has, for the velocities v and states xi of all elements, the equations
//
//     M v + N f(V, xi) = F,    xi = xi^ + g xi'(V, xi),    M = A / g = 1/g + H + g K
//
// nondimensional except for V = v times the unit of velocity. The states are eliminated element by
// element (friction_stage.hpp). V spans twelve decades, so that neither v nor log V is a good
// unknown: the friction of an element at rest hardly depends on v, that of a fast one hardly on
// log V. The unknown is z = c v + N f, the force on an element that its own stage balances, where
// c is the diagonal of M. The stage of one element is a scalar equation v = P(z) that always has a
// solution; coupled,
//
//     z + (M - c) P(z) = F.
//
// P is near zero below the strength and near a line of slope 1/c above it: a smoothed law of
// Coulomb, whose slipping elements Newton's method finds as it does for that law. Its matrix is
// that of the equation in v, M + diag(N df/dv), scaled from both sides by the square root of P',
// so that an element at rest drops out.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "ricochet/faults/friction_stage.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "stiffness_series.hpp"

namespace ricochet {

/// The operator M of stages of any length.
class StageStiffness {
public:
    /// @param bound  relative error of the polynomial for sqrt(K)
    /// @throws std::invalid_argument where the bound cannot be met.
    StageStiffness(const StrikeSlipFault& fault, double bound);

    /// g, positive, nondimensional.
    void set_length(double g);
    [[nodiscard]] double length() const noexcept { return g_; }

    /// y = M x.
    void apply(const Eigen::VectorXd& x, Eigen::VectorXd& y);
    /// y = M x with an approximate sqrt(K), off by up to `rough`, in a few products.
    void approximate(const Eigen::VectorXd& x, Eigen::VectorXd& y);
    static constexpr double rough = 0.05;

    /// M_jj of the middle element.
    [[nodiscard]] double diagonal() const noexcept;
    /// Component i of (H + g K) 1.
    [[nodiscard]] double on_ones(Eigen::Index i) const { return h_ones_[i] + g_ * k_ones_[i]; }

    [[nodiscard]] StiffnessProduct& product() noexcept { return product_; }
    [[nodiscard]] int degree() const noexcept { return root_.degree(); }
    [[nodiscard]] double bound() const noexcept { return bound_; }

private:
    void apply(const StiffnessSeries& series, const Eigen::VectorXd& x, Eigen::VectorXd& y);

    double damping_;  // 2 zeta
    StiffnessProduct product_;
    StiffnessSeries root_, rough_root_;
    double bound_ = 0;
    double k_middle_ = 1, h_middle_ = 0;
    Eigen::VectorXd h_ones_, k_ones_;
    double g_ = 0;
    StiffnessSeries m_, rough_m_;
    StiffnessSeries::Scratch scratch_;
};

/// The right-hand side of a stage.
struct FaultStageEquation {
    Eigen::VectorXd force;  ///< F
    Eigen::VectorXd xi;     ///< xi^
};

/// State of the elements at the end of a stage.
struct FaultStagePoint {
    Eigen::VectorXd v;         ///< nondimensional
    Eigen::VectorXd xi;        ///< log(V* theta / D_RS)
    Eigen::VectorXd friction;  ///< coefficient
    Eigen::VectorXd ease;      ///< dv/dz, in [0, 1/c] where friction rises with the velocity
};

struct FaultStageReport {
    bool solved = false;
    int iterations = 0;  ///< of Newton's method
    int inner = 0;       ///< of conjugate gradients
    /// Largest over the elements of |M v + N f - F| relative to the sum of the terms' sizes.
    double residual = 0;
};

struct FaultStageOptions {
    double tolerance = 1e-11;  ///< of the residual
    int max_iterations = 40;   ///< of Newton's method
    int max_inner = 200;       ///< of conjugate gradients, in one iteration of Newton's method
};

/// Solves stages of one fault with one law. The fault and the stiffness must outlive it.
template <EliminableLaw Law>
class FaultFrictionStage {
public:
    /// @param normal  N of each element, nondimensional
    FaultFrictionStage(const Law& law, const StrikeSlipFault& fault, StageStiffness& stiffness,
                       const Eigen::VectorXd& normal, const FaultStageOptions& options = {})
        : law_(law),
          stiffness_(stiffness),
          normal_(normal),
          options_(options),
          velocity_unit_(fault.velocity_unit()),
          time_unit_(fault.time_unit())
    {
        for (Eigen::VectorXd* x : {&z_, &z0_, &mv_, &residual_, &step_, &root_ease_, &cg_r_, &cg_p_,
                                   &cg_x_, &cg_bp_, &cg_tp_}) {
            x->setZero(normal.size());
        }
    }

    /// `at.v` is a guess, replaced by the solution; the rest of `at` is written. If the stage is
    /// not solved, `at` is the point where the search ended.
    FaultStageReport solve(const FaultStageEquation& e, FaultStagePoint& at)
    {
        const double c = stiffness_.diagonal();
        for (Eigen::VectorXd* x : {&at.xi, &at.friction, &at.ease}) x->resize(normal_.size());
        stiffness_.approximate(at.v, mv_);
        z_ = e.force - mv_ + c * at.v;
        FaultStageReport out;
        double norm_before = std::numeric_limits<double>::infinity();
        double share = 1;  // fraction of Newton's step
        while (out.iterations < options_.max_iterations) {
            const bool found = at_forces(e, at);
            out.residual = found ? evaluate(e, at) : std::numeric_limits<double>::infinity();
            out.solved = out.residual <= options_.tolerance;
            if (out.solved) return out;
            const double norm = residual_.norm();
            if (!found || !(norm <= (1 - 1e-4 * share) * norm_before)) {
                share /= 2;
                if (out.iterations == 0 || share < 1e-3) return out;
                z_ = z0_ + share * step_;
                continue;
            }
            norm_before = norm;
            share = 1;
            ++out.iterations;
            if (!direction(at, 1e-2 * norm, out)) return out;
            z0_ = z_;
            z_ += step_;
        }
        return out;
    }

    /// Finds v, xi, f and dv/dz of every element separately under the forces z; true if all are
    /// found.
    bool at_forces(const FaultStageEquation& e, const Eigen::VectorXd& z, FaultStagePoint& at) const
    {
        const StateElimination<Law> eliminate(law_, stiffness_.length() * time_unit_);
        const double c = stiffness_.diagonal();
        StageEquation own{.c = c / velocity_unit_};
        for (Eigen::Index i = 0; i < z.size(); ++i) {
            own.normal_force = normal_[i];
            own.force = z[i];
            own.xi = e.xi[i];
            const StageSolution s = solve_stage(eliminate, own, at.v[i] * velocity_unit_);
            if (!s.report.solved) return false;
            at.v[i] = s.v / velocity_unit_;
            at.xi[i] = s.xi;
            at.friction[i] = s.friction;
            const double speed = std::abs(s.v);
            at.ease[i] = 0;
            if (!(speed > 0)) continue;
            const StageResponse r = eliminate(std::log(speed / eliminate.v_star()), speed, own.xi);
            const double v = std::abs(at.v[i]);
            at.ease[i] = v / (c * v + normal_[i] * r.friction_y);
        }
        return true;
    }

private:
    bool at_forces(const FaultStageEquation& e, FaultStagePoint& at) const
    {
        return at_forces(e, z_, at) && at.ease.minCoeff() >= 0;
    }

    /// M v + N f - F, and the largest of them relative to its terms.
    double evaluate(const FaultStageEquation& e, const FaultStagePoint& at)
    {
        stiffness_.apply(at.v, mv_);
        double worst = 0;
        for (Eigen::Index i = 0; i < mv_.size(); ++i) {
            const double grip = normal_[i] * at.friction[i];
            residual_[i] = mv_[i] + grip - e.force[i];
            const double size = std::abs(mv_[i]) + std::abs(grip) + std::abs(e.force[i]);
            const double share = std::abs(residual_[i]) / size;
            if (residual_[i] != 0 && !(share <= worst)) worst = share;  // also if it is NaN
        }
        return worst;
    }

    /// Newton's step in z: (1 + (M - c) P') step = -residual, by conjugate gradients on the
    /// symmetric form, to |rest| <= enough.
    bool direction(const FaultStagePoint& at, double enough, FaultStageReport& report)
    {
        const double c = stiffness_.diagonal();
        root_ease_ = at.ease.cwiseSqrt();
        step_ = -residual_;  // the rest of the step is -(M - c) dv
        cg_x_.setZero();
        cg_r_ = -root_ease_.cwiseProduct(residual_);
        cg_p_ = cg_r_;
        double rr = cg_r_.squaredNorm();
        // An error r of the scaled equation is an error r / root_ease <= r sqrt(c) or less.
        const double limit = enough * enough / c;
        for (int i = 0; i < options_.max_inner && rr > limit; ++i) {
            ++report.inner;
            cg_x_ = root_ease_.cwiseProduct(cg_p_);
            stiffness_.approximate(cg_x_, cg_bp_);
            cg_bp_ -= c * cg_x_;
            cg_tp_ = cg_p_ + root_ease_.cwiseProduct(cg_bp_);
            const double curvature = cg_p_.dot(cg_tp_);
            if (!(curvature > 0)) return false;
            const double alpha = rr / curvature;
            step_ -= alpha * cg_bp_;
            cg_r_ -= alpha * cg_tp_;
            const double next = cg_r_.squaredNorm();
            if (!std::isfinite(next)) return false;
            cg_p_ = cg_r_ + (next / rr) * cg_p_;
            rr = next;
        }
        return rr <= limit;
    }

    Law law_;
    StageStiffness& stiffness_;
    Eigen::VectorXd normal_;
    FaultStageOptions options_;
    double velocity_unit_, time_unit_;
    Eigen::VectorXd z_, z0_, mv_, residual_, step_, root_ease_;
    Eigen::VectorXd cg_r_, cg_p_, cg_x_, cg_bp_, cg_tp_;
};

}  // namespace ricochet
