// Queries and commands of the scene for an island.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "scene/contact_island.hpp"

namespace ricochet::detail {

IslandBody ContactIsland::body(std::uint32_t id) const
{
    const int i = place_of(id);
    IslandBody b = bodies_[static_cast<std::size_t>(i)];
    b.at = {q_[2 * i], q_[2 * i + 1]};
    b.velocity = {v_[2 * i], v_[2 * i + 1]};
    const int edge = edge_of(i);
    if (edge >= 0) b.spin = v_[edge] / b.radius;
    return b;
}

double ContactIsland::chord_spin(std::uint32_t id) const
{
    const int i = place_of(id);
    const int edge = edge_of(i);
    if (asleep_ || edge < 0) return 0;
    return v_next_[edge] / bodies_[static_cast<std::size_t>(i)].radius;
}

/// The momenta M v, as those of a problem.
void ContactIsland::set_momentum(const Eigen::VectorXd& v, LawProblem& problem) const
{
    problem.momentum = v;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        problem.momentum.segment<2>(2 * static_cast<Eigen::Index>(i)) *= bodies_[i].mass;
    }
    set_edges_momentum(v, problem);
}

void ContactIsland::set_edges_momentum(const Eigen::VectorXd& v, LawProblem& problem) const
{
    for (std::size_t i = 0; i < problem.turning.size(); ++i) {
        const auto k = static_cast<Eigen::Index>(2 * bodies_.size() + i);
        problem.momentum[k] = problem.turning[i] > 0 ? v[k] / problem.turning[i] : 0;
    }
}

void ContactIsland::set_velocity(std::uint32_t id, const std::array<double, 2>& velocity)
{
    const int i = place_of(id);
    v_.segment<2>(2 * i) << velocity[0], velocity[1];
    wake();
}

std::vector<IslandContact> ContactIsland::contacts() const
{
    std::vector<IslandContact> pushed;
    for (std::size_t k = 0; k < warm_.size(); ++k) {
        const auto i = 2 * static_cast<Eigen::Index>(k);
        if (!(warm_impulses_[i] > 0)) continue;
        pushed.push_back(public_contact(warm_[k], warm_impulses_[i], warm_impulses_[i + 1]));
    }
    return pushed;
}

std::vector<std::vector<std::uint32_t>> ContactIsland::groups() const
{
    std::vector<std::size_t> parent(bodies_.size());
    std::iota(parent.begin(), parent.end(), std::size_t{0});
    const auto root = [&](int body) {
        auto i = static_cast<std::size_t>(body);
        while (parent[i] != i) i = parent[i] = parent[parent[i]];
        return i;
    };
    const auto join = [&](int a, int b) {
        const auto [low, high] = std::minmax({root(a), root(b)});
        parent[high] = low;
    };
    for (const Link& k : links_) join(k.first, k.second);
    for (std::size_t k = 0; k < warm_.size(); ++k) {
        const bool pushes = warm_impulses_[2 * static_cast<Eigen::Index>(k)] > 0;
        if (pushes && !warm_[k].wall) join(warm_[k].body, warm_[k].other);
    }
    std::vector<std::vector<std::uint32_t>> members(bodies_.size());
    for (int i = 0; i < static_cast<int>(bodies_.size()); ++i) {
        members[root(i)].push_back(bodies_[static_cast<std::size_t>(i)].id);
    }
    std::erase_if(members, [](const auto& group) { return group.empty(); });
    return members;
}

double ContactIsland::energy() const
{
    double sum = 0;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        const auto k = 2 * static_cast<Eigen::Index>(i);
        sum += bodies_[i].mass *
               (v_.segment<2>(k).squaredNorm() / 2 - gravity_[0] * q_[k] - gravity_[1] * q_[k + 1]);
        const int edge = edge_of(static_cast<int>(i));
        if (edge >= 0) sum += v_[edge] * v_[edge] / problem_.turning[i] / 2;
    }
    for (const Link& k : links_) {
        const double length =
            (q_.segment<2>(2 * k.first) - q_.segment<2>(2 * k.second)).norm() - k.rest;
        sum += k.stiffness * length * length / 2;
    }
    return sum;
}

StrikeReport ContactIsland::strike()
{
    StrikeReport report;
    excluded_.clear();
    std::vector<double> reach;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        reach.push_back(closed_gap * size_of(static_cast<int>(i)));
    }
    find_touches(reach);
    problem_.couplings.clear();
    problem_.contacts.clear();
    problem_.inertia.clear();
    for (const IslandBody& b : bodies_) problem_.inertia.push_back(b.mass);
    set_momentum(v_, problem_);
    const Eigen::VectorXd still = Eigen::VectorXd::Zero(v_.size());
    report.energy_before = energy_between(v_, still);
    std::vector<std::array<double, 2>> wall_velocities;
    for (const Touch& touch : touches_) {
        LawContact contact = law_contact(touch, options_.step);
        contact.offset[0] -= std::max(touch.gap, -closed_gap * size_of(touch.body)) / options_.step;
        wall_velocities.push_back(contact.offset);
        const double approach = relative_normal(touch, v_) + contact.offset[0];
        if (approach < 0) contact.offset[0] += touch.law.restitution * approach;
        problem_.contacts.push_back(contact);
    }
    Eigen::VectorXd p;
    Eigen::VectorXd v;
    report.law = law_.solve(problem_, p, v);
    double work = 0;  // of moving walls
    report.energy_after = energy_between(v, still);
    for (std::size_t k = 0; k < wall_velocities.size(); ++k) {
        const auto i = 2 * static_cast<Eigen::Index>(k);
        work -= p[i] * wall_velocities[k][0] + p[i + 1] * wall_velocities[k][1];
    }
    if (!report.law.converged) {
        report.refused = true;
        report.message = "the impact has no solution that was found";
    } else if (report.energy_after > (report.energy_before + work) * (1 + 1e-9)) {
        report.refused = true;
        report.message = fmt::format(
            "Newton's restitution and Coulomb's friction together would raise the energy from {} "
            "to {} J; expected restitution 0 where contacts with friction are struck together",
            report.energy_before + work, report.energy_after);
    } else {
        v_ = v;
        wake();
    }
    return report;
}

}  // namespace ricochet::detail
