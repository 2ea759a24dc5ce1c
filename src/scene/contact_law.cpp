#include "scene/contact_law.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "ricochet/detail/contact_problem.hpp"

namespace ricochet::detail {

namespace {

/// rho in units of a contact's own inertia. A defect of velocity shrinks by about this factor at
/// each use of a matrix, and the rounding of velocities grows by it in the impulses. Sets that run
/// in circles under the first may settle under the second.
constexpr double stiff = 1e5;
constexpr double less_stiff = 1e3;

/// Up to this many unknowns a dense matrix is factored faster than a sparse one.
constexpr Eigen::Index few_unknowns = 24;

/// Where a defect no longer halves, rounding has been reached.
constexpr double rounding = 1e-14;

/// Sweeps cost a hundredth of a factor. These numbers are from piles of 5 to 160 discs: with 40
/// iterations in a row problems with friction take three to ten times as long, as active sets run
/// in circles that sweeps leave.
constexpr int sweeps_before = 4;
constexpr int first_batch = 30;
constexpr int iterations_with_friction = 6;
constexpr int iterations_without = 15;
constexpr int iterations_less_stiff = 30;
constexpr int rounds_of_one = 3;
constexpr int most_rounds = 7;

}  // namespace

ContactLaw::Pair ContactLaw::relative(const LawContact& c, const Eigen::VectorXd& v) const
{
    double x = v[2 * c.first];
    double y = v[2 * c.first + 1];
    if (c.second >= 0) {
        x -= v[2 * c.second];
        y -= v[2 * c.second + 1];
    }
    const auto [nx, ny] = c.normal;
    return {nx * x + ny * y + c.offset[0], nx * y - ny * x + c.offset[1]};
}

/// b += G' p of one contact.
void ContactLaw::push(const LawContact& c, double normal, double tangential, Eigen::VectorXd& b)
{
    const auto [nx, ny] = c.normal;
    const double x = nx * normal - ny * tangential;
    const double y = ny * normal + nx * tangential;
    b[2 * c.first] += x;
    b[2 * c.first + 1] += y;
    if (c.second < 0) return;
    b[2 * c.second] -= x;
    b[2 * c.second + 1] -= y;
}

/// The inertia against which a contact pushes, without springs [kg].
double ContactLaw::unit(const LawContact& c) const
{
    const double first = problem_->inertia[static_cast<std::size_t>(c.first)];
    if (c.second < 0) return first;
    const double second = problem_->inertia[static_cast<std::size_t>(c.second)];
    return first * second / (first + second);
}

void ContactLaw::add_block(int row, int column, const Eigen::Matrix2d& block)
{
    for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) {
            if (small_) {
                dense_(2 * row + i, 2 * column + j) += block(i, j);
            } else {
                triplets_.emplace_back(2 * row + i, 2 * column + j, block(i, j));
            }
        }
    }
}

void ContactLaw::factor_inertia()
{
    if (problem_->couplings.empty()) return;
    const bool small = small_;
    small_ = false;
    triplets_.clear();
    for (std::size_t i = 0; i < problem_->inertia.size(); ++i) {
        add_block(static_cast<int>(i), static_cast<int>(i),
                  problem_->inertia[i] * Eigen::Matrix2d::Identity());
    }
    for (const LawCoupling& k : problem_->couplings) {
        const Eigen::Matrix2d block{{k.xx, k.xy}, {k.xy, k.yy}};
        add_block(k.first, k.first, block);
        add_block(k.second, k.second, block);
        add_block(k.first, k.second, -block);
        add_block(k.second, k.first, -block);
    }
    const Eigen::Index n = problem_->momentum.size();
    sparse_.resize(n, n);
    sparse_.setFromTriplets(triplets_.begin(), triplets_.end());
    inertia_factor_.compute(sparse_);
    small_ = small;
}

/// The order of elimination belongs to the pairs in contact, and is kept while they stay.
void ContactLaw::compare_pattern()
{
    std::vector<std::array<int, 2>> pattern;
    pattern.reserve(problem_->contacts.size() + problem_->couplings.size() + 1);
    pattern.push_back({static_cast<int>(problem_->inertia.size()), -2});
    for (const LawCoupling& k : problem_->couplings) pattern.push_back({k.first, k.second});
    for (const LawContact& c : problem_->contacts) {
        if (c.second >= 0) pattern.push_back({c.first, c.second});
    }
    if (pattern == pattern_) return;
    pattern_.swap(pattern);
    ldlt_analyzed_ = lu_analyzed_ = false;
}

/// v = A^-1 (b + G' p)
void ContactLaw::follow(const Eigen::VectorXd& p, Eigen::VectorXd& v)
{
    v = problem_->momentum;
    Eigen::Index i = 0;
    for (const LawContact& c : problem_->contacts) {
        if (p[i] != 0 || p[i + 1] != 0) push(c, p[i], p[i + 1], v);
        i += 2;
    }
    if (!problem_->couplings.empty()) {
        v = inertia_factor_.solve(v).eval();
        return;
    }
    for (std::size_t b = 0; b < problem_->inertia.size(); ++b) {
        v.segment<2>(2 * static_cast<Eigen::Index>(b)) /= problem_->inertia[b];
    }
}

/// The largest relative velocity without impulses, in units of equal mass: gaps that are open
/// count where they would close alone.
void ContactLaw::set_scale(const Eigen::VectorXd& free)
{
    scale_ = 0;
    for (const LawContact& c : problem_->contacts) {
        const Pair u = relative(c, free);
        const double normal = u.normal < 0 ? std::max(-u.normal, std::abs(u.normal - c.offset[0]))
                                           : std::abs(u.normal - c.offset[0]);
        const double largest = std::max(normal, std::abs(u.tangential));
        scale_ = std::max(scale_, largest * std::sqrt(unit(c)));
    }
}

double ContactLaw::residual(const Eigen::VectorXd& p, const Eigen::VectorXd& v) const
{
    double worst = 0;
    Eigen::Index i = 0;
    for (const LawContact& c : problem_->contacts) {
        const Pair u = relative(c, v);
        const double mass = unit(c);
        const double bound = c.friction * std::max(0.0, p[i]);
        const double held = std::clamp(p[i + 1] - mass * u.tangential, -bound, bound);
        const double defect =
            std::max(std::abs(std::min(p[i], mass * u.normal)), std::abs(p[i + 1] - held));
        if (!std::isfinite(defect)) return std::numeric_limits<double>::infinity();
        worst = std::max(worst, defect / std::sqrt(mass));
        i += 2;
    }
    return scale_ > 0 ? worst / scale_ : worst;
}

/// What is active at (p, v); false where nothing has changed.
bool ContactLaw::choose(const Eigen::VectorXd& p, const Eigen::VectorXd& v)
{
    const auto& contacts = problem_->contacts;
    chosen_.resize(contacts.size());
    symmetric_ = true;
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const LawContact& c = contacts[k];
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const Pair u = relative(c, v);
        const double rho = stiffness_ * unit(c);
        const double normal = p[i] - rho * u.normal;
        chosen_[k] = Active::open;
        if (!(normal > 0)) continue;
        const double tangential = p[i + 1] - rho * u.tangential;
        const double bound = c.friction * normal;
        if (c.friction == 0) {
            chosen_[k] = Active::slips_forward;
        } else if (std::abs(tangential) > bound) {
            chosen_[k] = tangential > 0 ? Active::slips_forward : Active::slips_backward;
            symmetric_ = false;
        } else {
            chosen_[k] = Active::sticks;
        }
    }
    const bool changed = chosen_ != active_;
    active_.swap(chosen_);
    return changed;
}

/// A + G' D G, with D = -dp/du of what is active.
bool ContactLaw::factor()
{
    const Eigen::Index n = problem_->momentum.size();
    small_ = n <= few_unknowns;
    if (small_) {
        dense_.setZero(n, n);
    } else {
        triplets_.clear();
    }
    for (std::size_t b = 0; b < problem_->inertia.size(); ++b) {
        add_block(static_cast<int>(b), static_cast<int>(b),
                  problem_->inertia[b] * Eigen::Matrix2d::Identity());
    }
    const auto couple = [this](int a, int b, const Eigen::Matrix2d& block) {
        add_block(a, a, block);
        if (b < 0) return;
        add_block(b, b, block);
        add_block(a, b, -block);
        add_block(b, a, -block);
    };
    for (const LawCoupling& k : problem_->couplings) {
        couple(k.first, k.second, Eigen::Matrix2d{{k.xx, k.xy}, {k.xy, k.yy}});
    }
    for (std::size_t k = 0; k < problem_->contacts.size(); ++k) {
        const LawContact& c = problem_->contacts[k];
        const Eigen::Vector2d normal(c.normal[0], c.normal[1]);
        const Eigen::Vector2d tangent(-c.normal[1], c.normal[0]);
        const double rho = stiffness_ * unit(c);
        // Open contacts keep their places, so that the pattern of the matrix is the contacts'.
        Eigen::Matrix2d block = Eigen::Matrix2d::Zero();
        if (active_[k] == Active::sticks) {
            block = rho * Eigen::Matrix2d::Identity();
        } else if (active_[k] != Active::open) {
            const double slope = active_[k] == Active::slips_forward ? c.friction : -c.friction;
            block = rho * (normal + slope * tangent) * normal.transpose();
        }
        couple(c.first, c.second, block);
    }
    if (small_) {
        dense_lu_.compute(dense_);
        return true;
    }
    sparse_.resize(n, n);
    sparse_.setFromTriplets(triplets_.begin(), triplets_.end());
    if (symmetric_) {
        if (!std::exchange(ldlt_analyzed_, true)) sparse_ldlt_.analyzePattern(sparse_);
        sparse_ldlt_.factorize(sparse_);
        return sparse_ldlt_.info() == Eigen::Success;
    }
    if (!std::exchange(lu_analyzed_, true)) sparse_lu_.analyzePattern(sparse_);
    sparse_lu_.factorize(sparse_);
    return sparse_lu_.info() == Eigen::Success;
}

/// The impulses of the active contacts with the velocities that follow from them.
void ContactLaw::improve(Eigen::VectorXd& p)
{
    const auto& contacts = problem_->contacts;
    right_ = problem_->momentum;
    const auto slope = [&](std::size_t k) {
        return active_[k] == Active::slips_forward ? contacts[k].friction : -contacts[k].friction;
    };
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        if (active_[k] == Active::open) continue;
        const LawContact& c = contacts[k];
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const double rho = stiffness_ * unit(c);
        const double normal = p[i] - rho * c.offset[0];
        const bool sticks = active_[k] == Active::sticks;
        push(c, normal, sticks ? p[i + 1] - rho * c.offset[1] : slope(k) * normal, right_);
    }
    linear_ = small_       ? Eigen::VectorXd(dense_lu_.solve(right_))
              : symmetric_ ? Eigen::VectorXd(sparse_ldlt_.solve(right_))
                           : Eigen::VectorXd(sparse_lu_.solve(right_));
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const LawContact& c = contacts[k];
        const auto i = 2 * static_cast<Eigen::Index>(k);
        if (active_[k] == Active::open) {
            p[i] = p[i + 1] = 0;
            continue;
        }
        const Pair u = relative(c, linear_);
        const double rho = stiffness_ * unit(c);
        p[i] -= rho * u.normal;
        if (active_[k] == Active::sticks) {
            p[i + 1] -= rho * u.tangential;
        } else {
            p[i + 1] = slope(k) * p[i];
        }
    }
}

/// The nearest impulses within the law's bounds.
void ContactLaw::confine(Eigen::VectorXd& p) const
{
    Eigen::Index i = 0;
    for (const LawContact& c : problem_->contacts) {
        p[i] = std::max(0.0, p[i]);
        p[i + 1] = std::clamp(p[i + 1], -c.friction * p[i], c.friction * p[i]);
        i += 2;
    }
}

/// From (p, v); true and there the solution, or false and there the best that was found.
bool ContactLaw::newton(Eigen::VectorXd& p, Eigen::VectorXd& v, int most, LawReport& report)
{
    Eigen::VectorXd multiplier = p;
    linear_ = v;
    double last = std::numeric_limits<double>::infinity();
    active_.clear();
    for (int iteration = 0; iteration < most; ++iteration) {
        // The set follows from the velocities of the linear equations: those of the impulses
        // carry their rounding, which rho would magnify.
        const bool changed = choose(multiplier, linear_);
        if (changed || iteration == 0) {
            ++report.factors;
            if (!factor()) break;
        }
        ++report.iterations;
        improve(multiplier);
        if (!multiplier.allFinite()) break;
        trial_p_ = multiplier;
        confine(trial_p_);
        follow(trial_p_, trial_v_);
        const double now = residual(trial_p_, trial_v_);
        if (now < report.residual) {
            report.residual = now;
            p = trial_p_, v = trial_v_;
        }
        const bool stagnates = !(now < last / 2);
        last = now;
        if (now <= rounding || (report.residual <= tolerance_ && stagnates && !changed)) break;
    }
    return report.residual <= tolerance_;
}

/// Where A is diagonal one contact after the other, with the others' impulses as they are; else all
/// together, with a length at which the defects do not grow.
void ContactLaw::relax(Eigen::VectorXd& p, Eigen::VectorXd& v, int times)
{
    if (problem_->couplings.empty()) {
        for (int k = 0; k < times; ++k) sweep(p, v);
        return follow(p, v);
    }
    std::vector<int> count(problem_->inertia.size(), 0);
    for (const LawContact& c : problem_->contacts) {
        ++count[static_cast<std::size_t>(c.first)];
        if (c.second >= 0) ++count[static_cast<std::size_t>(c.second)];
    }
    const double part = 1.0 / std::ranges::max(count);
    for (int k = 0; k < times; ++k) {
        Eigen::Index i = 0;
        for (const LawContact& c : problem_->contacts) {
            const Pair u = relative(c, v);
            p[i] -= part * unit(c) * u.normal;
            p[i + 1] -= part * unit(c) * u.tangential;
            i += 2;
        }
        confine(p);
        follow(p, v);
    }
}

void ContactLaw::sweep(Eigen::VectorXd& p, Eigen::VectorXd& v)
{
    const auto& inertia = problem_->inertia;
    Eigen::Index i = 0;
    for (const LawContact& c : problem_->contacts) {
        const Pair u = relative(c, v);
        const double mass = unit(c);
        const double normal = std::max(0.0, p[i] - mass * u.normal);
        const double bound = c.friction * normal;
        const double tangential = std::clamp(p[i + 1] - mass * u.tangential, -bound, bound);
        const double n = normal - p[i];
        const double t = tangential - p[i + 1];
        p[i] = normal, p[i + 1] = tangential;
        i += 2;
        const double x = c.normal[0] * n - c.normal[1] * t;
        const double y = c.normal[1] * n + c.normal[0] * t;
        const double first = inertia[static_cast<std::size_t>(c.first)];
        v[2 * c.first] += x / first;
        v[2 * c.first + 1] += y / first;
        if (c.second < 0) continue;
        const double second = inertia[static_cast<std::size_t>(c.second)];
        v[2 * c.second] -= x / second;
        v[2 * c.second + 1] -= y / second;
    }
}

void ContactLaw::solve_densely(Eigen::VectorXd& p, Eigen::VectorXd& v, LawReport& report)
{
    const Eigen::Index n = p.size();
    const Eigen::VectorXd free_p = Eigen::VectorXd::Zero(n);
    Eigen::VectorXd free, column;
    follow(free_p, free);
    Eigen::MatrixXd w(n, n);
    Eigen::VectorXd q(n);
    std::vector<double> friction;
    const auto& contacts = problem_->contacts;
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const Pair u = relative(contacts[k], free);
        q[2 * static_cast<Eigen::Index>(k)] = u.normal;
        q[2 * static_cast<Eigen::Index>(k) + 1] = u.tangential;
        friction.push_back(contacts[k].friction);
    }
    for (Eigen::Index j = 0; j < n; ++j) {
        follow(Eigen::VectorXd::Unit(n, j), column);
        for (std::size_t k = 0; k < contacts.size(); ++k) {
            const Pair u = relative(contacts[k], column);
            w(2 * static_cast<Eigen::Index>(k), j) = u.normal;
            w(2 * static_cast<Eigen::Index>(k) + 1, j) = u.tangential;
        }
    }
    // `follow` is affine: without what it is for no impulse, the columns are those of W.
    w.colwise() -= q;
    w = (0.5 * (w + w.transpose())).eval();
    Eigen::VectorXd trial = p;
    ContactSolver solver({.tolerance = tolerance_ / 10});
    solver.solve(w, q, friction, 2, trial);
    confine(trial);
    follow(trial, column);
    const double defect = residual(trial, column);
    report.dense = true;
    if (defect < report.residual) {
        report.residual = defect;
        p = trial, v = column;
    }
}

LawReport ContactLaw::solve(const LawProblem& problem, Eigen::VectorXd& p, Eigen::VectorXd& v)
{
    problem_ = &problem;
    const auto n = 2 * static_cast<Eigen::Index>(problem.contacts.size());
    factor_inertia();
    LawReport report;
    Eigen::VectorXd zero = Eigen::VectorXd::Zero(n);
    follow(zero, v);
    set_scale(v);
    if (p.size() != n || !p.allFinite()) p = zero;
    bool pushed = false;
    for (const LawContact& c : problem.contacts) pushed = pushed || relative(c, v).normal < 0;
    if (!pushed) {
        p = zero;
        report.converged = v.allFinite();
        return report;
    }
    if (!p.isZero(0)) follow(p, v);
    report.residual = residual(p, v);
    for (; report.sweeps < sweeps_before && report.residual > rounding; ++report.sweeps) {
        relax(p, v, 1);
        report.residual = residual(p, v);
    }
    report.converged = report.residual <= rounding || iterate(p, v, report);
    if (!report.converged && std::isfinite(report.residual) && problem.contacts.size() <= 100) {
        solve_densely(p, v, report);
        report.converged = report.residual <= tolerance_;
    }
    return report;
}

/// Newton's method and, where it runs in circles, ever more sweeps between its attempts.
bool ContactLaw::iterate(Eigen::VectorXd& p, Eigen::VectorXd& v, LawReport& report)
{
    compare_pattern();
    const bool rubs =
        std::ranges::any_of(problem_->contacts, [](const LawContact& c) { return c.friction > 0; });
    const int most = rubs ? iterations_with_friction : iterations_without;
    bool converged = newton(p, v, most, report);
    int batch = first_batch;
    for (int round = 0; !converged && round < most_rounds; ++round, batch *= 2) {
        relax(p, v, batch);
        report.sweeps += batch;
        // What Newton's method finds replaces the sweeps' only where nothing better has been seen.
        if (round >= rounds_of_one) {
            stiffness_ = less_stiff;
            converged = newton(p, v, iterations_less_stiff, report);
            stiffness_ = stiff;
        }
        converged = converged || newton(p, v, most, report);
    }
    if (!converged) report.residual = residual(p, v);
    return converged;
}

}  // namespace ricochet::detail
