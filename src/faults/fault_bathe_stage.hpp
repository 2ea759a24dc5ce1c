// A stage of Bathe's step on a fault: a variational inequality, solved by Newton's method with
// conjugate gradients.
#pragma once

#include <algorithm>
#include <cmath>

#include "fault_forces.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::detail {

using Eigen::Index;
using Eigen::VectorXd;

/// One stage, where v > 0: v = start + g (overload b(0) - K d - H v) + friction (b(0) - b(s)), d
/// and s as above. Written with b(0) and b(s) apart, it would lose a small overload to rounding.
struct StageOfFault {
    double g = 0;
    double friction = 0;
    VectorXd start;    ///< w
    VectorXd slip;     ///< d where v = 0
    VectorXd path;     ///< s where v = 0
    VectorXd at_path;  ///< where the bound is evaluated, if extrapolated
};

struct Solved {
    bool converged = false;
    int iterations = 0;  // of Newton's method
};

/// Solves stages.
class StageSolver {
public:
    StageSolver(const StrikeSlipFault& fault, FaultForces& forces, const BatheOptions& options)
        : fault_(fault), forces_(forces), options_(options)
    {
        for (VectorXd* v : {&rhs_, &q_, &residual_, &p_, &ap_, &softening_})
            v->setZero(fault.size());
        sign_.setZero(fault.size());
    }

    /// `v` is a guess, replaced by the solution.
    Solved solve(const StageOfFault& stage, VectorXd& v)
    {
        prepare(stage);
        multiply(v, q_);
        Solved out;
        for (; out.iterations < options_.max_iterations; ++out.iterations) {
            if (classify(stage, v)) multiply(v, q_);
            evaluate(stage, v);
            const double size = residual_.norm();
            if (!std::isfinite(size)) return out;
            largest_ = std::max(largest_, v.norm());
            const double enough = options_.tolerance * std::max(v.norm(), 1e-6 * largest_);
            if (size <= enough && settled_) {
                out.converged = true;
                return out;
            }
            if (size > 0 && !improve(v, std::max(0.3 * enough, 1e-3 * size))) return out;
        }
        return out;
    }

private:
    void prepare(const StageOfFault& stage)
    {
        if (stage.g != g_) {
            g_ = stage.g;
            const double damping = 2 * fault_.parameters().damping;
            a_.combine(forces_.root_of_stiffness(), 1, g_ * g_, damping * g_);
        }
        forces_.product()(stage.slip, rhs_);
        const double overload = fault_.parameters().overload;
        for (Index i = 0; i < rhs_.size(); ++i) {
            rhs_[i] = stage.start[i] + stage.g * (overload * forces_.first_strength(i) - rhs_[i]);
        }
        settled_ = false;
    }

    void multiply(const VectorXd& x, VectorXd& y) { a_.apply(forces_.product(), x, y, scratch_); }

    /// What friction adds to the right-hand side of an element that slips in the direction `sign`.
    [[nodiscard]] double friction(const StageOfFault& stage, Index i, double v, double sign) const
    {
        const bool implicit = options_.bound == FaultBound::implicit;
        const double path = implicit ? stage.path[i] + stage.g * std::abs(v) : stage.at_path[i];
        const double forward = fault_.weakening(i, path);
        return stage.friction * (sign > 0 ? forward : forward + 2 * fault_.strength(i, path));
    }

    /// Direction in which each element slips, by the proximal map at v; elements that stick are
    /// stopped. Returns whether any element was stopped.
    bool classify(const StageOfFault& stage, VectorXd& v)
    {
        bool stopped = false;
        settled_ = true;
        for (Index i = 0; i < v.size(); ++i) {
            const double z = rhs_[i] - q_[i] + v[i];
            const double sign = z + friction(stage, i, v[i], 1) > 0    ? 1
                                : z + friction(stage, i, v[i], -1) < 0 ? -1
                                                                       : 0;
            if (sign != sign_[i]) settled_ = false;
            sign_[i] = sign;
            if (sign == 0 && v[i] != 0) {
                v[i] = 0;
                stopped = true;
            }
        }
        if (stopped) settled_ = false;
        return stopped;
    }

    /// Residual of the elements that slip, and the amount by which friction softens them.
    void evaluate(const StageOfFault& stage, const VectorXd& v)
    {
        const bool implicit = options_.bound == FaultBound::implicit;
        const double drop = fault_.parameters().friction_drop;
        for (Index i = 0; i < v.size(); ++i) {
            residual_[i] = softening_[i] = 0;
            if (sign_[i] == 0) continue;
            residual_[i] = rhs_[i] + friction(stage, i, v[i], sign_[i]) - q_[i];
            // A velocity against its own sign has no bound of its own: the bound at rest is used.
            if (implicit && sign_[i] * v[i] >= 0) {
                softening_[i] = stage.friction * stage.g * fault_.weight()[i] * drop *
                                std::exp(-(stage.path[i] + stage.g * std::abs(v[i])));
            }
        }
    }

    /// Conjugate gradients on the elements that slip; q follows v, so that no product is wasted.
    bool improve(VectorXd& v, double enough)
    {
        p_ = residual_;
        double rr = residual_.squaredNorm();
        for (int i = 0; i < options_.max_inner; ++i) {
            multiply(p_, ap_);
            double curvature = 0;
            for (Index k = 0; k < p_.size(); ++k)
                curvature += p_[k] * (ap_[k] - softening_[k] * p_[k]);
            if (!(curvature > 0)) return false;
            const double alpha = rr / curvature;
            v += alpha * p_;
            q_ += alpha * ap_;
            for (Index k = 0; k < p_.size(); ++k) {
                if (sign_[k] != 0) residual_[k] -= alpha * (ap_[k] - softening_[k] * p_[k]);
            }
            const double next = residual_.squaredNorm();
            if (!std::isfinite(next)) return false;
            if (next <= enough * enough) return true;
            p_ = residual_ + (next / rr) * p_;
            rr = next;
        }
        return false;
    }

    const StrikeSlipFault& fault_;
    FaultForces& forces_;
    const BatheOptions& options_;
    double g_ = 0;
    double largest_ = 0;
    bool settled_ = false;  // the signs are those of the last time
    StiffnessSeries a_;
    StiffnessSeries::Scratch scratch_;
    VectorXd rhs_, q_, residual_, p_, ap_, softening_, sign_;
};

}  // namespace ricochet::detail
