#include "scene/contact_law.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "ricochet/nonsmooth/contact_problem.hpp"

namespace ricochet::detail {

namespace {

/// rho in units of a contact's own inertia. A defect of velocity shrinks by about this factor at
/// each use of a matrix, and the rounding of velocities grows by it in the impulses. Active sets
/// that cycle with the first value may settle with the second.
constexpr double stiff = 1e5;
constexpr double less_stiff = 1e3;

/// [contacts] The dense solver's time grows with the cube.
constexpr std::size_t most_dense = 100;

/// A larger defect justifies the last resorts.
constexpr double loose = 1e-7;

/// Where a defect no longer halves, rounding has been reached.
constexpr double rounding = 1e-14;

/// A sweep costs a hundredth of a factorisation. These numbers are from piles of 5 to 160 discs:
/// with 40 consecutive iterations problems with friction take three to ten times as long, as active
/// sets cycle, which sweeps end.
constexpr int sweeps_before = 4;
constexpr int first_batch = 30;
constexpr int iterations_with_friction = 6;
constexpr int iterations_without = 15;
constexpr int iterations_less_stiff = 30;
constexpr int rounds_of_one = 3;
constexpr int most_rounds = 7;
constexpr int last_batch = 4000;

}  // namespace

ContactLaw::Pair ContactLaw::relative(const LawContact& c, const Eigen::VectorXd& v)
{
    double x = v[2 * c.first];
    double y = v[2 * c.first + 1];
    if (c.second >= 0) {
        x -= v[2 * c.second];
        y -= v[2 * c.second + 1];
    }
    const auto [nx, ny] = c.normal;
    Pair u{nx * x + ny * y + c.offset[0], nx * y - ny * x + c.offset[1]};
    for (const int edge : c.edges) {
        if (edge >= 0) u.tangential -= v[edge];
    }
    return u;
}

/// Adds G' p of one contact to b.
void ContactLaw::push(const LawContact& c, double normal, double tangential, Eigen::VectorXd& b)
{
    const auto [nx, ny] = c.normal;
    const double x = nx * normal - ny * tangential;
    const double y = ny * normal + nx * tangential;
    b[2 * c.first] += x;
    b[2 * c.first + 1] += y;
    for (const int edge : c.edges) {
        if (edge >= 0) b[edge] -= tangential;
    }
    if (c.second < 0) return;
    b[2 * c.second] -= x;
    b[2 * c.second + 1] -= y;
}

/// Finds the units of inertia of the contacts.
void ContactLaw::set_units()
{
    units_.clear();
    const std::size_t bodies = problem_->inertia.size();
    for (const LawContact& c : problem_->contacts) {
        double normal = problem_->inertia[static_cast<std::size_t>(c.first)];
        if (c.second >= 0) {
            const double second = problem_->inertia[static_cast<std::size_t>(c.second)];
            normal = normal * second / (normal + second);
        }
        double of_edges = 0;
        for (const int edge : c.edges) {
            if (edge >= 0)
                of_edges += problem_->turning[static_cast<std::size_t>(edge) - 2 * bodies];
        }
        units_.push_back({normal, of_edges > 0 ? 1 / (1 / normal + of_edges) : normal});
    }
}

/// Stiffnesses of a contact.
ContactLaw::Pair ContactLaw::rho(std::size_t k) const
{
    return {stiffness_ * units_[k].normal, stiffness_ * units_[k].tangential};
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
    const auto count = static_cast<Eigen::Index>(problem_->turning.size());
    for (Eigen::Index b = 0; b < count; ++b) {
        v[2 * count + b] *= problem_->turning[static_cast<std::size_t>(b)];
    }
}

/// The largest relative velocity without impulses, in units of equal mass: open gaps count at the
/// velocity at which they would close exactly. Two bodies that move together have none, except for
/// the rounding of their velocities, from which no solution can be distinguished.
void ContactLaw::set_scale(const Eigen::VectorXd& free)
{
    scale_ = 0;
    for (std::size_t k = 0; k < problem_->contacts.size(); ++k) {
        const LawContact& c = problem_->contacts[k];
        const Pair u = relative(c, free);
        const double normal = u.normal < 0 ? std::max(-u.normal, std::abs(u.normal - c.offset[0]))
                                           : std::abs(u.normal - c.offset[0]);
        const double largest = std::max(normal, std::abs(u.tangential));
        double speed = free.segment<2>(2 * c.first).norm();
        if (c.second >= 0) speed = std::max(speed, free.segment<2>(2 * c.second).norm());
        for (const int edge : c.edges) {
            if (edge >= 0) speed = std::max(speed, std::abs(free[edge]));
        }
        const double told = 8 * std::numeric_limits<double>::epsilon() / tolerance_ * speed;
        scale_ = std::max(scale_, std::max(largest, told) * std::sqrt(units_[k].normal));
    }
}

double ContactLaw::residual(const Eigen::VectorXd& p, const Eigen::VectorXd& v) const
{
    double worst = 0;
    Eigen::Index i = 0;
    for (const LawContact& c : problem_->contacts) {
        const Pair u = relative(c, v);
        const auto [mass, across] = units_[static_cast<std::size_t>(i / 2)];
        const double bound = c.friction * std::max(0.0, p[i]);
        const double held = std::clamp(p[i + 1] - across * u.tangential, -bound, bound);
        const double normal = std::abs(std::min(p[i], mass * u.normal));
        const double tangential = std::abs(p[i + 1] - held);
        const double defect =
            across == mass ? std::max(normal, tangential) / std::sqrt(mass)
                           : std::max(normal / std::sqrt(mass), tangential / std::sqrt(across));
        if (!std::isfinite(defect)) return std::numeric_limits<double>::infinity();
        worst = std::max(worst, defect);
        i += 2;
    }
    return scale_ > 0 ? worst / scale_ : worst;
}

/// Chooses the active contacts at p and the relative velocities u; false if none has changed.
bool ContactLaw::choose(const Eigen::VectorXd& p, const Eigen::VectorXd& u)
{
    const auto& contacts = problem_->contacts;
    chosen_.resize(contacts.size());
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const LawContact& c = contacts[k];
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const auto [stiff_n, stiff_t] = rho(k);
        const double normal = p[i] - stiff_n * u[i];
        chosen_[k] = Active::open;
        if (!(normal > 0)) continue;
        const double tangential = p[i + 1] - stiff_t * u[i + 1];
        const double bound = c.friction * normal;
        if (c.friction == 0) {
            chosen_[k] = Active::slips_forward;
        } else if (std::abs(tangential) > bound) {
            chosen_[k] = tangential > 0 ? Active::slips_forward : Active::slips_backward;
        } else {
            chosen_[k] = Active::sticks;
        }
    }
    const bool changed = chosen_ != active_;
    active_.swap(chosen_);
    return changed;
}

/// The impulses of the active contacts, and the relative velocities u that belong to them. Only the
/// change of velocities is solved for: the rounding of the velocities themselves would be
/// magnified by rho, beyond the forces of a short step on moving bodies.
void ContactLaw::improve(Eigen::VectorXd& p, Eigen::VectorXd& u)
{
    const auto& contacts = problem_->contacts;
    follow(p, trial_v_);
    right_.setZero(trial_v_.size());
    const auto slope = [&](std::size_t k) {
        return active_[k] == Active::slips_forward ? contacts[k].friction : -contacts[k].friction;
    };
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const LawContact& c = contacts[k];
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const Pair now = relative(c, trial_v_);
        u.segment<2>(i) << now.normal, now.tangential;
        if (active_[k] == Active::open) {
            if (p[i] != 0 || p[i + 1] != 0) push(c, -p[i], -p[i + 1], right_);
            continue;
        }
        const auto [stiff_n, stiff_t] = rho(k);
        const double normal = -stiff_n * u[i];
        const bool sticks = active_[k] == Active::sticks;
        push(c, normal, sticks ? -stiff_t * u[i + 1] : slope(k) * (p[i] + normal) - p[i + 1],
             right_);
    }
    linear_ = solve_factored(right_);
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const LawContact& c = contacts[k];
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const Pair change = relative(c, linear_);
        u[i] += change.normal - c.offset[0];
        u[i + 1] += change.tangential - c.offset[1];
        if (active_[k] == Active::open) {
            p[i] = p[i + 1] = 0;
            continue;
        }
        const auto [stiff_n, stiff_t] = rho(k);
        p[i] -= stiff_n * u[i];
        if (active_[k] == Active::sticks) {
            p[i + 1] -= stiff_t * u[i + 1];
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

/// Starts from (p, v). True: they are the solution; false: they are the best point found.
bool ContactLaw::newton(Eigen::VectorXd& p, Eigen::VectorXd& v, int most, LawReport& report,
                        bool active_given)
{
    Eigen::VectorXd multiplier = p;
    Eigen::VectorXd u(p.size());
    for (Eigen::Index i = 0; i < p.size(); i += 2) {
        const Pair now = relative(problem_->contacts[static_cast<std::size_t>(i / 2)], v);
        u.segment<2>(i) << now.normal, now.tangential;
    }
    double last = std::numeric_limits<double>::infinity();
    if (!active_given) active_.clear();
    for (int iteration = 0; iteration < most; ++iteration) {
        const bool changed = iteration == 0 && active_given ? true : choose(multiplier, u);
        if (changed || iteration == 0) {
            ++report.factors;
            if (!factor()) break;
        }
        ++report.iterations;
        improve(multiplier, u);
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

/// Relaxes one contact after the other where A is diagonal, with the others' impulses fixed; else
/// all together, with a step length at which the defects do not grow.
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
            const auto [mass, across] = units_[static_cast<std::size_t>(i / 2)];
            p[i] -= part * mass * u.normal;
            p[i + 1] -= part * across * u.tangential;
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
        const auto [mass, across] = units_[static_cast<std::size_t>(i / 2)];
        const double normal = std::max(0.0, p[i] - mass * u.normal);
        const double bound = c.friction * normal;
        const double tangential = std::clamp(p[i + 1] - across * u.tangential, -bound, bound);
        const double n = normal - p[i];
        const double t = tangential - p[i + 1];
        p[i] = normal, p[i + 1] = tangential;
        i += 2;
        for (const int edge : c.edges) {
            if (edge < 0) continue;
            v[edge] -= t * problem_->turning[static_cast<std::size_t>(edge) - 2 * inertia.size()];
        }
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
    // `follow` is affine: minus its value for zero impulses, the columns are those of W.
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

/// Relaxes the impulses of the start; false where none is needed.
bool ContactLaw::begin(const LawProblem& problem, Eigen::VectorXd& p, Eigen::VectorXd& v,
                       LawReport& report)
{
    problem_ = &problem;
    stiffness_ = stiff;
    set_units();
    const auto n = 2 * static_cast<Eigen::Index>(problem.contacts.size());
    factor_inertia();
    Eigen::VectorXd zero = Eigen::VectorXd::Zero(n);
    follow(zero, v);
    set_scale(v);
    if (p.size() != n || !p.allFinite()) p = zero;
    bool pushed = false;
    for (const LawContact& c : problem.contacts) pushed = pushed || relative(c, v).normal < 0;
    if (!pushed) {
        p = zero;
        report.converged = v.allFinite();
        return false;
    }
    if (!p.isZero(0)) follow(p, v);
    report.residual = residual(p, v);
    for (; report.sweeps < sweeps_before && report.residual > rounding; ++report.sweeps) {
        relax(p, v, 1);
        report.residual = residual(p, v);
    }
    return true;
}

/// The contacts of a problem whose A is diagonal. A wall is a body of infinite mass, beyond the
/// last one, as is an edge that does not turn.
void ContactLaw::lay_rows()
{
    rows_.clear();
    const auto& inertia = problem_->inertia;
    const Eigen::Index beyond = problem_->momentum.size();
    for (std::size_t k = 0; k < problem_->contacts.size(); ++k) {
        const LawContact& c = problem_->contacts[k];
        const bool wall = c.second < 0;
        rows_.push_back({.first = 2 * c.first,
                         .second = wall ? beyond : 2 * c.second,
                         .nx = c.normal[0],
                         .ny = c.normal[1],
                         .offset_n = c.offset[0],
                         .offset_t = c.offset[1],
                         .friction = c.friction,
                         .mass = units_[k].normal,
                         .by_first = 1 / inertia[static_cast<std::size_t>(c.first)],
                         .by_second = wall ? 0 : 1 / inertia[static_cast<std::size_t>(c.second)],
                         .edges = {beyond + 2, beyond + 2},
                         .mass_across = units_[k].tangential});
        for (std::size_t side = 0; side < 2; ++side) {
            if (c.edges[side] < 0) continue;
            const std::size_t body = static_cast<std::size_t>(c.edges[side]) - 2 * inertia.size();
            rows_.back().edges[side] = c.edges[side];
            rows_.back().by_edges[side] = problem_->turning[body];
        }
    }
}

/// As `sweep`; v has the velocity of walls and of their edges, which is zero, at its end.
template <bool turns>
void ContactLaw::sweep_rows(Eigen::VectorXd& p, Eigen::VectorXd& v) const
{
    double* impulse = p.data();
    for (const Row& c : rows_) {
        double* a = v.data() + c.first;
        double* b = v.data() + c.second;
        const double x = a[0] - b[0];
        const double y = a[1] - b[1];
        const double u_n = c.nx * x + c.ny * y + c.offset_n;
        double u_t = c.nx * y - c.ny * x + c.offset_t;
        if constexpr (turns) u_t -= v[c.edges[0]] + v[c.edges[1]];
        const double normal = std::max(0.0, impulse[0] - c.mass * u_n);
        const double bound = c.friction * normal;
        const double across = turns ? c.mass_across : c.mass;
        const double tangential = std::clamp(impulse[1] - across * u_t, -bound, bound);
        const double n = normal - impulse[0];
        const double t = tangential - impulse[1];
        impulse[0] = normal, impulse[1] = tangential;
        impulse += 2;
        const double push_x = c.nx * n - c.ny * t;
        const double push_y = c.ny * n + c.nx * t;
        a[0] += c.by_first * push_x;
        a[1] += c.by_first * push_y;
        b[0] -= c.by_second * push_x;
        b[1] -= c.by_second * push_y;
        if constexpr (turns) {
            v[c.edges[0]] -= c.by_edges[0] * t;
            v[c.edges[1]] -= c.by_edges[1] * t;
        }
    }
}

LawReport ContactLaw::settle(const LawProblem& problem, Eigen::VectorXd& p, Eigen::VectorXd& v,
                             double enough, bool polish)
{
    LawReport report;
    if (!begin(problem, p, v, report)) return report;
    const bool diagonal = problem.couplings.empty();
    if (diagonal) lay_rows();
    for (int batch = first_batch; report.residual > enough && batch < last_batch; batch *= 2) {
        if (diagonal) {
            v.conservativeResizeLike(Eigen::VectorXd::Zero(problem.momentum.size() + 3));
            for (int k = 0; k < batch; ++k)
                turns() ? sweep_rows<true>(p, v) : sweep_rows<false>(p, v);
            follow(p, v);
        } else {
            relax(p, v, batch);
        }
        report.sweeps += batch;
        report.residual = residual(p, v);
    }
    report.converged = report.residual <= tolerance_;
    if (report.converged || !polish) return report;
    compare_pattern();
    report.converged = newton(p, v, iterations_with_friction, report);
    return report;
}

LawReport ContactLaw::solve(const LawProblem& problem, Eigen::VectorXd& p, Eigen::VectorXd& v,
                            bool last_resorts)
{
    LawReport report;
    if (!begin(problem, p, v, report)) return report;
    report.converged = report.residual <= rounding || iterate(p, v, last_resorts, report);
    const bool small = problem.contacts.size() <= most_dense;
    if (report.residual > loose && std::isfinite(report.residual) && last_resorts && small) {
        solve_densely(p, v, report);
        report.converged = report.residual <= tolerance_;
    }
    return report;
}

/// Newton's method; where it cycles, paths with friction; then more and more sweeps between
/// attempts.
bool ContactLaw::iterate(Eigen::VectorXd& p, Eigen::VectorXd& v, bool last_resorts,
                         LawReport& report)
{
    compare_pattern();
    const bool rubs =
        std::ranges::any_of(problem_->contacts, [](const LawContact& c) { return c.friction > 0; });
    const int most = rubs ? iterations_with_friction : iterations_without;
    bool converged = newton(p, v, most, report);
    if (!converged) {
        converged = along_paths(p, v, report);
    }
    stiffness_ = stiff;
    int batch = first_batch;
    for (int round = 0;
         !converged && last_resorts && report.residual > loose && round < most_rounds;
         ++round, batch *= 2) {
        relax(p, v, batch);
        report.sweeps += batch;
        // The result of Newton's method replaces that of the sweeps only if it is the best so far.
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
