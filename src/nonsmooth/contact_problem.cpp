#include "ricochet/nonsmooth/contact_problem.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/require.hpp"

namespace ricochet {

namespace {

/// One contact with one tangent: rest, stick or slip. Unique if friction |W_nt| < W_nn.
bool close_in_plane(const Eigen::Matrix3d& w, const Eigen::Vector3d& q, double friction,
                    Eigen::Vector3d& p)
{
    const double determinant = w(0, 0) * w(1, 1) - w(0, 1) * w(1, 0);
    if (determinant > 0) {
        p[0] = (w(0, 1) * q[1] - w(1, 1) * q[0]) / determinant;
        p[1] = (w(1, 0) * q[0] - w(0, 0) * q[1]) / determinant;
        if (std::abs(p[1]) <= friction * p[0]) return true;
    }
    for (const double sign : {1.0, -1.0}) {
        p[0] = -q[0] / (w(0, 0) - sign * friction * w(0, 1));
        p[1] = -sign * friction * p[0];
        if (sign * (q[1] + w(1, 0) * p[0] + w(1, 1) * p[1]) >= 0) return true;
    }
    return false;
}

/// The impulse of one contact if its solution is unique and known in closed form.
bool close_form(const Eigen::Matrix3d& w, const Eigen::Vector3d& q, double friction, int tangents,
                Eigen::Vector3d& p)
{
    p.setZero();
    const double coupling = std::hypot(w(0, 1), tangents == 2 ? w(0, 2) : 0);
    if (!(friction * coupling < w(0, 0))) return false;
    if (q[0] >= 0) return true;
    p[0] = -q[0] / w(0, 0);
    if (friction == 0) return true;
    if (tangents == 1) return close_in_plane(w, q, friction, p);
    if (coupling != 0 || w(1, 2) != 0 || w(1, 1) != w(2, 2) || !(w(1, 1) > 0)) return false;
    const double holding = std::hypot(q[1], q[2]) / w(1, 1);
    const double bound = friction * p[0];
    const double share = holding > bound ? bound / holding : 1;
    p[1] = -share * q[1] / w(1, 1);
    p[2] = -share * q[2] / w(1, 1);
    return true;
}

}  // namespace

ContactSolver::ContactSolver(const ContactOptions& options) : options_(options)
{
    detail::require(options.tolerance > 0, "ContactOptions", "tolerance", "be positive",
                    options.tolerance);
}

void ContactSolver::scale(const Eigen::MatrixXd& w, const Eigen::VectorXd& q,
                          std::span<const double> friction, int components)
{
    if (components != 2 && components != 3) {
        throw std::invalid_argument(
            fmt::format("ContactSolver: a contact has 2 or 3 components, got {}: a normal one and "
                        "1 or 2 tangents",
                        components));
    }
    const auto n = static_cast<Eigen::Index>(friction.size()) * components;
    if (w.rows() != n || w.cols() != n || q.size() != n) {
        throw std::invalid_argument(
            fmt::format("ContactSolver: {} contacts of {} components need a matrix and a vector "
                        "of {}, got {} x {} and {}",
                        friction.size(), components, n, w.rows(), w.cols(), q.size()));
    }
    for (const double coefficient : friction) {
        if (!(coefficient >= 0) || !std::isfinite(coefficient)) {
            throw std::invalid_argument(fmt::format(
                "ContactSolver: friction must be finite, zero or positive, got {}", coefficient));
        }
    }
    if (!w.allFinite() || !q.allFinite()) {
        throw std::invalid_argument("ContactSolver: the matrix and the vector must be finite");
    }
    components_ = components;
    friction_ = friction;
    units_.resize(n);
    for (Eigen::Index i = 0; i < n; i += components) {
        const double mean = w.diagonal().segment(i, components).mean();
        units_.segment(i, components).setConstant(mean > 0 ? 1 / std::sqrt(mean) : 1);
    }
    w_.noalias() = units_.asDiagonal() * w * units_.asDiagonal();
    q_ = units_.cwiseProduct(q);
}

/// f = p - P(p - rho u), of which u_ keeps rho u.
void ContactSolver::defects(const Eigen::VectorXd& p, Eigen::VectorXd& f)
{
    u_.noalias() = w_ * p;
    u_ += q_;
    if (rho_ != 1) u_ *= rho_;
    f.resize(p.size());
    for (Eigen::Index i = 0; i < p.size(); i += components_) {
        const double coefficient = friction_[static_cast<std::size_t>(i / components_)];
        f[i] = std::min(p[i], u_[i]);
        const double bound = coefficient * std::max(0.0, p[i]);
        const int tangents = components_ - 1;
        const auto z = p.segment(i + 1, tangents) - u_.segment(i + 1, tangents);
        const double length = tangents == 1 ? std::abs(z[0]) : std::hypot(z[0], z[1]);
        const double factor = length > bound ? bound / length : 1;
        f.segment(i + 1, tangents) = p.segment(i + 1, tangents) - factor * z;
    }
}

double ContactSolver::measure(const Eigen::VectorXd& p, const Eigen::VectorXd& f) const
{
    const double size = q_.lpNorm<Eigen::Infinity>();
    const double worst = f.lpNorm<Eigen::Infinity>();
    if (!p.allFinite() || !std::isfinite(worst)) return std::numeric_limits<double>::infinity();
    return size > 0 ? worst / size : worst;
}

/// An element of the generalised Jacobian of the defects at p, after `defects`.
void ContactSolver::jacobian(const Eigen::VectorXd& p)
{
    v_.setZero(p.size(), p.size());
    for (Eigen::Index i = 0; i < p.size(); i += components_) {
        const double coefficient = friction_[static_cast<std::size_t>(i / components_)];
        if (p[i] <= u_[i]) {
            v_(i, i) = 1;
        } else {
            v_.row(i) = rho_ * w_.row(i);
        }
        const double bound = coefficient * std::max(0.0, p[i]);
        const double slope = p[i] > 0 ? coefficient : 0;
        const Eigen::Index t = i + 1;
        const int tangents = components_ - 1;
        const double z0 = p[t] - u_[t];
        const double z1 = tangents == 2 ? p[t + 1] - u_[t + 1] : 0;
        const double length = std::hypot(z0, z1);
        if (length <= bound) {
            v_.middleRows(t, tangents) = rho_ * w_.middleRows(t, tangents);
            continue;
        }
        // p_t - bound z / |z|, and with two tangents the derivative of the direction of z.
        const double e0 = z0 / length;
        const double e1 = z1 / length;
        for (int k = 0; k < tangents; ++k) {
            v_(t + k, t + k) += 1;
            v_(t + k, i) -= slope * (k == 0 ? e0 : e1);
        }
        if (tangents == 2 && bound > 0) {
            const double turn = bound / length;
            const double a = turn * (1 - e0 * e0);
            const double b = -turn * e0 * e1;
            const double c = turn * (1 - e1 * e1);
            v_.row(t) += rho_ * (a * w_.row(t) + b * w_.row(t + 1));
            v_.row(t + 1) += rho_ * (b * w_.row(t) + c * w_.row(t + 1));
            v_(t, t) -= a, v_(t, t + 1) -= b;
            v_(t + 1, t) -= b, v_(t + 1, t + 1) -= c;
        }
    }
}

/// Solves once more with the last factors, which reduces the error of regularisation to rounding.
void ContactSolver::polish()
{
    direction_ = -lu_.solve(f_);
    best_ = trial_ + direction_;
    defects(best_, f_trial_);
    if (f_trial_.lpNorm<Eigen::Infinity>() < f_.lpNorm<Eigen::Infinity>()) trial_.swap(best_);
}

/// The residual of p with rho = 1.
double ContactSolver::unscaled_residual(const Eigen::VectorXd& p)
{
    const double rho = std::exchange(rho_, 1.0);
    defects(p, f_trial_);
    rho_ = rho;
    return measure(p, f_trial_);
}

/// Newton's method from p_. True: p_ is the solution; false: p_ is as before, or better.
bool ContactSolver::newton(ContactReport& report)
{
    trial_ = p_;
    defects(trial_, f_);
    for (int iteration = 0;; ++iteration) {
        report.residual = rho_ == 1 ? measure(trial_, f_) : unscaled_residual(trial_);
        if (report.residual <= options_.tolerance) {
            if (iteration > 0) polish();
            p_ = trial_;
            return true;
        }
        if (iteration == options_.max_iterations || !std::isfinite(report.residual)) return false;
        ++report.iterations;
        jacobian(trial_);
        // Redundant contacts make it singular: undetermined impulses are left nearly as they are.
        v_.diagonal().array() += 1e-13;
        lu_.compute(v_);
        direction_ = -lu_.solve(f_);
        if (!direction_.allFinite()) return false;
        const double merit = f_.squaredNorm();
        double share = 1;
        for (int halving = 0;; ++halving, share /= 2) {
            best_ = trial_ + share * direction_;
            defects(best_, f_trial_);
            if (f_trial_.squaredNorm() <= (1 - 2e-4 * share) * merit) break;
            if (halving == 12) return false;
        }
        trial_.swap(best_);
        f_.swap(f_trial_);
    }
}

/// Newton's method on problems with W + softness I and q - softness p, where p is the solution of
/// the one before: their solutions converge to one of the problem itself, if it has one.
bool ContactSolver::proximal(ContactReport& report)
{
    diagonal_ = w_.diagonal();
    free_ = q_;
    start_ = p_;
    bool solved = false;
    for (const double softness : {1e-8, 1e-6, 1e-4}) {
        p_ = start_;
        for (int k = 0; k < 20 && !solved; ++k) {
            w_.diagonal() = diagonal_.array() + softness;
            q_ = free_ - softness * p_;
            rho_ = 1 / softness;
            const bool found = newton(report);
            rho_ = 1;
            w_.diagonal() = diagonal_;
            q_ = free_;
            if (!found) break;
            defects(p_, f_);
            report.residual = measure(p_, f_);
            solved = report.residual <= options_.tolerance;
        }
        if (solved) return true;
    }
    p_ = start_;
    return false;
}

/// Solves one contact with the others' impulses fixed: the normal impulse that stops the
/// approach, then the friction within its bound, repeated until both agree.
void ContactSolver::solve_contact(Eigen::Index c, double relaxation)
{
    const Eigen::Index i = c * components_;
    const int tangents = components_ - 1;
    const double coefficient = friction_[static_cast<std::size_t>(c)];
    Eigen::Vector3d free = Eigen::Vector3d::Zero();
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    Eigen::Matrix3d w = Eigen::Matrix3d::Identity();
    p.head(components_) = p_.segment(i, components_);
    w.topLeftCorner(components_, components_) = w_.block(i, i, components_, components_);
    free.head(components_) = q_.segment(i, components_) + w_.middleRows(i, components_) * p_;
    free -= w * p;
    const Eigen::Vector3d before = p;
    if (free[0] >= 0) {
        p.setZero();
    } else {
        // Sticking, if the impulse that it needs lies in the cone.
        Eigen::Vector3d holding = Eigen::Vector3d::Zero();
        holding.head(components_) =
            -w.topLeftCorner(components_, components_).ldlt().solve(free.head(components_));
        const double tangential = std::hypot(holding[1], tangents == 2 ? holding[2] : 0);
        if (holding.allFinite() && tangential <= coefficient * holding[0]) {
            p = holding;
        } else {
            const double rho = 1 / w.bottomRightCorner<2, 2>().diagonal().maxCoeff();
            for (int k = 0; k < 30; ++k) {
                const Eigen::Vector3d last = p;
                const double drive = free[0] + w(0, 1) * p[1] + w(0, 2) * p[2];
                p[0] = w(0, 0) > 0 ? std::max(0.0, -drive / w(0, 0)) : 0;
                const Eigen::Vector3d u = free + w * p;
                double z1 = p[1] - rho * u[1];
                double z2 = tangents == 2 ? p[2] - rho * u[2] : 0;
                const double length = std::hypot(z1, z2);
                const double bound = coefficient * p[0];
                if (length > bound) z1 *= bound / length, z2 *= bound / length;
                p[1] = z1, p[2] = z2;
                if ((p - last).lpNorm<Eigen::Infinity>() <= 1e-15 * p.lpNorm<Eigen::Infinity>())
                    break;
            }
        }
    }
    p = before + relaxation * (p - before);
    if (p.allFinite()) p_.segment(i, components_) = p.head(components_);
}

void ContactSolver::sweep(double relaxation)
{
    const auto contacts = static_cast<Eigen::Index>(friction_.size());
    for (Eigen::Index c = 0; c < contacts; ++c) {
        solve_contact(c, relaxation);
    }
}

ContactReport ContactSolver::solve(const Eigen::MatrixXd& w, const Eigen::VectorXd& q,
                                   std::span<const double> friction, int components,
                                   Eigen::VectorXd& p)
{
    scale(w, q, friction, components);
    if (p.size() != q.size()) {
        throw std::invalid_argument(fmt::format(
            "ContactSolver: the impulses must have {} components, got {}", q.size(), p.size()));
    }
    ContactReport report;
    if (friction.size() == 1) {
        Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
        Eigen::Vector3d free = Eigen::Vector3d::Zero();
        Eigen::Vector3d closed;
        one.topLeftCorner(components, components) = w;
        free.head(components) = q;
        if (close_form(one, free, friction[0], components - 1, closed)) {
            trial_ = closed.head(components);
            report = residual(w, q, friction, components, trial_);
            if (report.converged) {
                p = trial_;
                return report;
            }
        }
    }
    iterate(p, report);
    const int iterations = report.iterations;
    const int sweeps = report.sweeps;
    report = residual(w, q, friction, components, p);
    report.iterations = iterations;
    report.sweeps = sweeps;
    return report;
}

/// Tries the four states of one contact with one tangent: open, sticking, slipping either way. With
/// much friction W is far from monotone, and Newton's method may not find the one that is
/// consistent. True: p_ is a solution.
bool ContactSolver::enumerate(ContactReport& report)
{
    if (friction_.size() != 1 || components_ != 2) return false;
    const auto& w = w_;
    const auto& q = q_;
    start_ = p_;
    const auto fits = [&](double normal, double tangential) {
        if (!std::isfinite(normal) || !std::isfinite(tangential)) return false;
        p_[0] = normal, p_[1] = tangential;
        defects(p_, f_);
        report.residual = measure(p_, f_);
        return report.residual <= options_.tolerance;
    };
    const double determinant = w(0, 0) * w(1, 1) - w(0, 1) * w(1, 0);
    if (fits(0, 0) || fits((w(0, 1) * q[1] - w(1, 1) * q[0]) / determinant,
                           (w(1, 0) * q[0] - w(0, 0) * q[1]) / determinant)) {
        return true;
    }
    for (const double sign : {1.0, -1.0}) {
        const double normal = -q[0] / (w(0, 0) - sign * friction_[0] * w(0, 1));
        if (fits(normal, -sign * friction_[0] * normal)) return true;
    }
    p_ = start_;
    return false;
}

void ContactSolver::iterate(Eigen::VectorXd& p, ContactReport& report)
{
    p_ = p.cwiseQuotient(units_);
    // Without a velocity no impulse is needed, and there is no scale to measure defects by.
    if (!p_.allFinite() || q_.isZero(0)) p_.setZero();
    bool solved = newton(report) || enumerate(report) || proximal(report);
    // Sweeps, with more of them each time between the attempts of Newton's method.
    for (int batch = 5; !solved && report.sweeps < options_.max_sweeps; batch = 2 * batch) {
        // Where full sweeps cycle, damped ones may converge.
        const double relaxation = batch > 100 ? 0.7 : 1;
        for (int k = 0; k < batch && report.sweeps < options_.max_sweeps; ++k, ++report.sweeps) {
            sweep(relaxation);
        }
        solved = newton(report) || proximal(report);
    }
    p = units_.cwiseProduct(p_);
    // Newton's method leaves the error of its regularisation; one factor corrects the normal
    // velocity of a single contact.
    const double stop = friction_.size() == 1 && p_[0] > 0 ? w_.row(0).dot(p_) : 0;
    if (solved && stop > 0) p *= -q_[0] / stop;
}

ContactReport ContactSolver::residual(const Eigen::MatrixXd& w, const Eigen::VectorXd& q,
                                      std::span<const double> friction, int components,
                                      const Eigen::VectorXd& p)
{
    scale(w, q, friction, components);
    p_ = p.cwiseQuotient(units_);
    defects(p_, f_);
    ContactReport report;
    report.residual = measure(p_, f_);
    if (f_.size() > 0) {
        Eigen::Index worst = 0;
        f_.cwiseAbs().maxCoeff(&worst);
        report.contact = static_cast<int>(worst / components);
    }
    report.converged = report.residual <= options_.tolerance;
    return report;
}

}  // namespace ricochet
