// Several contacts with friction together, at one instant or over one step.
//
//     u = W p + q,     for every contact c:
//     0 <= p_n,  u_n >= 0,  p_n u_n = 0,      |p_t| <= friction p_n,
//     p_t = -friction p_n u_t / |u_t| where u_t is not zero
//
// with u the relative velocities and p the impulses (or accelerations and forces) of the
// contacts, normal component first; W = H M^-1 H' is positive semidefinite. With one
// tangent a contact has two components, with two tangents three.
//
// Such a problem may have many solutions (where W is singular the impulses of redundant
// contacts are not determined; with much friction not even the velocities), or none.
#pragma once

#include <Eigen/Dense>

#include <span>
#include <string_view>

namespace ricochet {

/// How the solution of a contact problem ended.
struct ContactReport {
    bool converged = false;
    /// The largest defect over the contacts, of velocity or impulse, in units in which W has a
    /// unit diagonal in each contact, as a fraction of the largest component of q in these
    /// units. It is not relative to p, which grows without bound where there is no solution, so
    /// that every defect would be small compared with it.
    double residual = 0;
    int iterations = 0;  ///< of Newton's method, in all its attempts
    int sweeps = 0;      ///< over the contacts, one at a time
    int contact = -1;    ///< the contact of the largest defect
};

/// Tolerance and limits of `ContactSolver`.
struct ContactOptions {
    double tolerance = 1e-10;  ///< of the residual
    int max_iterations = 40;   ///< of one attempt of Newton's method
    int max_sweeps = 4000;
};

/// Solves contact problems of up to a number of components without allocating, once its
/// memory has grown to their size.
///
/// A single contact is solved in closed form if its solution is unique and needs no iteration.
/// Other problems are solved first by a semismooth Newton method on the projections
///
///     p_n = max(0, p_n - rho u_n),   p_t = P(|.| <= friction p_n)(p_t - rho u_t)
///
/// with a line search (P. Alart and A. Curnier, A mixed formulation for frictional contact
/// problems prone to Newton like solution methods, Computer Methods in Applied Mechanics
/// and Engineering 92, 1991) with rho = 1. Where redundant contacts ask for velocities that
/// differ a little, impulses have to change by far more than u, and this stalls. Then the same
/// method solves problems with a softness s, W + s I, by rho = 1 / s, each from the impulses of
/// the one before (the proximal point method; R. T. Rockafellar, Monotone operators and the
/// proximal point algorithm, SIAM Journal on Control and Optimization 14, 1976). The last resort
/// are sweeps that solve one contact after another (nonsmooth Gauss-Seidel), from which both
/// are restarted from time to time. The work is bounded; a problem that is not solved by then is
/// reported as unsolved.
class ContactSolver {
public:
    /// Keeps a copy of `options`.
    explicit ContactSolver(const ContactOptions& options = {});

    /// Improves `p`, the start of the iteration: the impulses of the previous step, or zero.
    ///
    /// @throws std::invalid_argument if the sizes do not fit, `components` is neither 2 nor
    /// 3, a coefficient of friction is negative or infinite, or a number is not finite.
    ContactReport solve(const Eigen::MatrixXd& w, const Eigen::VectorXd& q,
                        std::span<const double> friction, int components, Eigen::VectorXd& p);

    /// The residual of `p`, as in the report.
    [[nodiscard]] ContactReport residual(const Eigen::MatrixXd& w, const Eigen::VectorXd& q,
                                         std::span<const double> friction, int components,
                                         const Eigen::VectorXd& p);

private:
    void scale(const Eigen::MatrixXd& w, const Eigen::VectorXd& q, std::span<const double> friction,
               int components);
    void defects(const Eigen::VectorXd& p, Eigen::VectorXd& f);
    [[nodiscard]] double measure(const Eigen::VectorXd& p, const Eigen::VectorXd& f) const;
    [[nodiscard]] bool newton(ContactReport& report);
    [[nodiscard]] double unscaled_residual(const Eigen::VectorXd& p);
    [[nodiscard]] bool proximal(ContactReport& report);
    void polish();
    void iterate(Eigen::VectorXd& p, ContactReport& report);
    [[nodiscard]] bool enumerate(ContactReport& report);
    void jacobian(const Eigen::VectorXd& p);
    void sweep(double relaxation);
    void solve_contact(Eigen::Index c, double relaxation);

    ContactOptions options_;
    int components_ = 2;
    double rho_ = 1;  // of the projections
    std::span<const double> friction_;
    Eigen::VectorXd units_;  // 1 / sqrt of the mean diagonal of W in each contact
    Eigen::MatrixXd w_;      // in these units, as are the following
    Eigen::VectorXd q_, p_, u_, f_, direction_, trial_, f_trial_, best_;
    Eigen::VectorXd diagonal_, free_, start_;  // of the given problem, while a softer one is solved
    Eigen::MatrixXd v_;
    Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
};

}  // namespace ricochet
