// Paths to the solution of a contact law, from one contact's change to the next.
#include <algorithm>
#include <cmath>
#include <limits>

#include "scene/contact_law.hpp"

namespace ricochet::detail {

namespace {

constexpr int most_paths = 6;
constexpr int iterations_after_path = 8;

/// Where discs turn, chains of them roll freely between stiff contacts: with 1e9 elimination loses
/// so many digits of these motions that the defect grows from one iteration to the next.
constexpr double stiffest_turning = 1e7;

}  // namespace

/// Starts a path at (p, v): p is the projection of w, and w is p - rho u where possible.
void ContactLaw::begin_path(const Eigen::VectorXd& p, const Eigen::VectorXd& v)
{
    const auto& contacts = problem_->contacts;
    const auto n = static_cast<Eigen::Index>(contacts.size());
    path_.w.resize(2 * n);
    path_.shift.resize(2 * n);
    active_.assign(contacts.size(), Active::open);
    for (Eigen::Index i = 0; i < 2 * n; i += 2) {
        const auto k = static_cast<std::size_t>(i / 2);
        const LawContact& c = contacts[k];
        const Pair u = relative(c, v);
        const auto [stiff_n, stiff_t] = rho(k);
        const double normal = p[i] - stiff_n * u.normal;
        const double tangential = p[i + 1] - stiff_t * u.tangential;
        // Stays off the boundaries between states, at a different distance for each contact.
        const double part = std::fmod(0.618033988749895 * static_cast<double>(k + 1), 1.0);
        const double margin = 1e-3 * (1 + part) * scale_ * std::sqrt(units_[k].normal);
        const double bound = c.friction * p[i];
        Eigen::Vector2d w(p[i], p[i + 1]);
        if (!(p[i] > 0)) {
            w = {std::min(normal, -margin), tangential};
        } else if (c.friction == 0) {
            active_[k] = Active::slips_forward;
            w[1] = tangential;
        } else if (std::abs(p[i + 1]) < bound * (1 - 1e-12)) {
            active_[k] = Active::sticks;
        } else {
            const double sign = p[i + 1] > 0 ? 1 : -1;
            active_[k] = sign > 0 ? Active::slips_forward : Active::slips_backward;
            w[1] = sign * std::max(sign * tangential, bound + margin);
        }
        path_.w.segment<2>(i) = w;
        path_.shift.segment<2>(i) = w - Eigen::Vector2d(normal, tangential);
    }
    path_.left = 1;
    path_.left_rate = -1;
}

/// Finds the direction in which the path continues with the present states of contacts, keeping the
/// sense of `left`.
void ContactLaw::turn_path()
{
    const auto& contacts = problem_->contacts;
    right_.setZero(problem_->momentum.size());
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        if (active_[k] == Active::open) continue;
        const LawContact& c = contacts[k];
        const auto shift =
            path_.left_rate * path_.shift.segment<2>(2 * static_cast<Eigen::Index>(k));
        const double slope = active_[k] == Active::slips_forward ? c.friction : -c.friction;
        push(c, shift[0], active_[k] == Active::sticks ? shift[1] : slope * shift[0], right_);
    }
    linear_ = solve_factored(right_);
    path_.w_rate.resize(path_.w.size());
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const LawContact& c = contacts[k];
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const Pair u = relative(c, linear_);
        const auto [stiff_n, stiff_t] = rho(k);
        path_.w_rate[i] = path_.left_rate * path_.shift[i] - stiff_n * (u.normal - c.offset[0]);
        path_.w_rate[i + 1] =
            path_.left_rate * path_.shift[i + 1] - stiff_t * (u.tangential - c.offset[1]);
    }
}

/// Finds the first contact that changes its state along the path.
ContactLaw::Switch ContactLaw::next_switch() const
{
    Switch first{.after = std::numeric_limits<double>::infinity()};
    for (std::size_t k = 0; k < problem_->contacts.size(); ++k) {
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const double friction = problem_->contacts[k].friction;
        const double normal = path_.w[i];
        const double normal_rate = path_.w_rate[i];
        const double tangential = path_.w[i + 1];
        const double tangential_rate = path_.w_rate[i + 1];
        // `inside` is positive in the state that the contact has.
        const auto ends = [&](double inside, double rate, Active to) {
            if (!(rate < 0)) return;
            const double after = std::max(0.0, inside / -rate);
            if (after < first.after) first = {after, k, to};
        };
        const Active slips =
            tangential > 0 || friction == 0 ? Active::slips_forward : Active::slips_backward;
        switch (active_[k]) {
            case Active::open: ends(-normal, -normal_rate, slips); break;
            case Active::sticks:
                ends(friction * normal - tangential, friction * normal_rate - tangential_rate,
                     Active::slips_forward);
                ends(friction * normal + tangential, friction * normal_rate + tangential_rate,
                     Active::slips_backward);
                break;
            case Active::slips_forward:
            case Active::slips_backward: {
                ends(normal, normal_rate, Active::open);
                if (friction == 0) break;
                const double sign = active_[k] == Active::slips_forward ? 1 : -1;
                ends(sign * tangential - friction * normal,
                     sign * tangential_rate - friction * normal_rate, Active::sticks);
                break;
            }
        }
    }
    return first;
}

/// Moves the path to that change and past it. If it would turn back into the state that it has just
/// left, it continues in the opposite sense.
void ContactLaw::pass(const Switch& next)
{
    path_.w += next.after * path_.w_rate;
    path_.left += next.after * path_.left_rate;
    const std::size_t k = next.contact;
    const Active from = active_[k];
    active_[k] = next.to;
    if (!factor()) return;
    turn_path();
    const auto i = 2 * static_cast<Eigen::Index>(k);
    const double friction = problem_->contacts[k].friction;
    const Active slip = next.to == Active::sticks || next.to == Active::open ? from : next.to;
    const double sign = slip == Active::slips_forward ? 1 : -1;
    const double normal = path_.w_rate[i];
    const double slipping = sign * path_.w_rate[i + 1] - friction * normal;
    const double onward = next.to == Active::open     ? -normal
                          : from == Active::open      ? normal
                          : next.to == Active::sticks ? -slipping
                                                      : slipping;
    if (onward >= 0) return;
    path_.left_rate = -path_.left_rate;
    path_.w_rate = -path_.w_rate;
}

/// Follows the path until the shift is zero; false if it does not get there.
bool ContactLaw::follow_path(LawReport& report)
{
    if (!factor()) return false;
    turn_path();
    const auto most = 50 + 10 * static_cast<int>(problem_->contacts.size());
    for (int k = 0; k < most; ++k) {
        const Switch next = next_switch();
        const double end =
            path_.left_rate < 0 ? path_.left : std::numeric_limits<double>::infinity();
        if (end <= next.after) {
            path_.w += end * path_.w_rate;
            return std::isfinite(end);
        }
        ++report.switches;
        ++report.factors;
        pass(next);
    }
    return false;
}

void ContactLaw::impulses_of_path(Eigen::VectorXd& p) const
{
    p = path_.w;
    for (std::size_t k = 0; k < problem_->contacts.size(); ++k) {
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const double slope = active_[k] == Active::slips_forward ? problem_->contacts[k].friction
                                                                 : -problem_->contacts[k].friction;
        if (active_[k] == Active::open) {
            p[i] = p[i + 1] = 0;
        } else if (active_[k] != Active::sticks) {
            p[i + 1] = slope * p[i];
        }
    }
}

/// Starts from zero impulses, with a shift that opens all contacts, from which Lemke's method
/// reaches the end wherever there is a solution.
void ContactLaw::begin_path_afar()
{
    const auto& contacts = problem_->contacts;
    const auto n = static_cast<Eigen::Index>(contacts.size());
    trial_p_.setZero(2 * n);
    follow(trial_p_, trial_v_);
    path_.w.resize(2 * n);
    path_.shift.setZero(2 * n);
    active_.assign(contacts.size(), Active::open);
    double deepest = 0;
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const LawContact& c = contacts[k];
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const Pair u = relative(c, trial_v_);
        const auto [stiff_n, stiff_t] = rho(k);
        path_.w.segment<2>(i) << -stiff_n * u.normal, -stiff_t * u.tangential;
        deepest = std::max(deepest, path_.w[i] / std::sqrt(units_[k].normal));
    }
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const auto i = 2 * static_cast<Eigen::Index>(k);
        const double part = std::fmod(0.618033988749895 * static_cast<double>(k + 1), 1.0);
        path_.shift[i] = -(1 + 1e-3 * (1 + part)) * deepest * std::sqrt(units_[k].normal);
        path_.w[i] += path_.shift[i];
    }
    path_.left = 1;
    path_.left_rate = -1;
}

bool ContactLaw::along_paths(Eigen::VectorXd& p, Eigen::VectorXd& v, LawReport& report)
{
    bool afar = false;
    for (int round = 0; round < most_paths; ++round) {
        stiffness_ = std::min(1e5 * std::pow(1e2, round), turns() ? stiffest_turning : 1e9);
        afar ? begin_path_afar() : begin_path(p, v);
        if (!follow_path(report)) {
            if (afar) return false;
            afar = true;
            continue;
        }
        afar = false;
        Eigen::VectorXd at_p;
        Eigen::VectorXd at_v;
        impulses_of_path(at_p);
        confine(at_p);
        follow(at_p, at_v);
        const double before = report.residual;
        const double now = residual(at_p, at_v);
        report.residual = std::min(before, now);
        const bool converged = newton(at_p, at_v, iterations_after_path, report, true);
        // The path's end is nearer to the solution, even if its residual has no smaller norm.
        p = at_p, v = at_v;
        if (converged) return true;
    }
    return false;
}

}  // namespace ricochet::detail
