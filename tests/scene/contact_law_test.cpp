// The contact law solved for velocities: random problems against the law itself and, if the
// solution is unique, against the dense solver.

#include "scene/contact_law.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "ricochet/nonsmooth/contact_problem.hpp"

namespace ricochet::detail::contact_law_test {
namespace {

class RandomLaw {
public:
    explicit RandomLaw(unsigned seed) : random_(seed) {}

    /// Bodies at random velocities, contacts between random ones or with walls, three per body:
    /// two more components than coordinates, so that impulses are not determined.
    LawProblem draw(int bodies, double friction, bool springs)
    {
        LawProblem problem;
        const double spread = uniform(0, 4);
        for (int i = 0; i < bodies; ++i) {
            problem.inertia.push_back(std::pow(10, uniform(-spread / 2, spread / 2)));
        }
        problem.momentum.resize(2 * bodies);
        for (int i = 0; i < 2 * bodies; ++i) {
            problem.momentum[i] = uniform(-1, 1) * problem.inertia[static_cast<std::size_t>(i / 2)];
        }
        for (int k = 0; k < 3 * bodies; ++k) {
            const int a = static_cast<int>(uniform(0, bodies));
            const int b = static_cast<int>(uniform(-1, bodies));
            const double angle = uniform(0, 6.283);
            problem.contacts.push_back({.first = a,
                                        .second = a == b ? -1 : b,
                                        .normal = {std::cos(angle), std::sin(angle)},
                                        .friction = friction * uniform(0, 1)});
        }
        for (int i = 0; springs && i + 1 < bodies; ++i) {
            problem.couplings.push_back({i, i + 1, uniform(0, 10), 0, uniform(0, 10)});
        }
        return problem;
    }

    /// The same with discs, two of three of which turn, from rings of radius r, I = m r^2, to a
    /// tenth of it.
    LawProblem draw_turning(int bodies, double friction, bool springs)
    {
        LawProblem problem = draw(bodies, friction, springs);
        problem.momentum.conservativeResize(3 * bodies);
        for (int i = 0; i < bodies; ++i) {
            const bool turns = i % 3 != 2;
            const double inertia = problem.inertia[static_cast<std::size_t>(i)] * uniform(0.1, 1);
            problem.turning.push_back(turns ? 1 / inertia : 0);
            problem.momentum[2 * bodies + i] = turns ? uniform(-1, 1) * inertia : 0;
        }
        for (LawContact& c : problem.contacts) {
            if (c.first % 3 != 2) c.edges[0] = 2 * bodies + c.first;
            if (c.second >= 0 && c.second % 3 != 2) c.edges[1] = 2 * bodies + c.second;
        }
        return problem;
    }

private:
    double uniform(double low, double high)
    {
        return std::uniform_real_distribution<double>(low, high)(random_);
    }
    std::mt19937 random_;
};

struct Defect {
    double law = 0, momentum = 0;
};

/// Violation of the law by p and v, in units of velocity, and of the equation of momenta.
Defect defect_of(const LawProblem& problem, const Eigen::VectorXd& p, const Eigen::VectorXd& v)
{
    Defect worst;
    Eigen::VectorXd left = -problem.momentum;
    const auto bodies = static_cast<Eigen::Index>(problem.inertia.size());
    for (Eigen::Index i = 0; i < 2 * bodies; ++i) {
        left[i] += problem.inertia[static_cast<std::size_t>(i / 2)] * v[i];
    }
    for (Eigen::Index i = 2 * bodies; i < v.size(); ++i) {
        const double turning = problem.turning[static_cast<std::size_t>(i - 2 * bodies)];
        if (turning > 0) left[i] += v[i] / turning;
        if (turning == 0) EXPECT_EQ(v[i], 0);
    }
    for (const LawCoupling& k : problem.couplings) {
        const Eigen::Vector2d u = v.segment<2>(2 * k.first) - v.segment<2>(2 * k.second);
        const Eigen::Vector2d f = Eigen::Matrix2d{{k.xx, k.xy}, {k.xy, k.yy}} * u;
        left.segment<2>(2 * k.first) += f;
        left.segment<2>(2 * k.second) -= f;
    }
    for (std::size_t k = 0; k < problem.contacts.size(); ++k) {
        const LawContact& c = problem.contacts[k];
        const Eigen::Vector2d n(c.normal[0], c.normal[1]);
        const Eigen::Vector2d t(-n[1], n[0]);
        Eigen::Vector2d u = v.segment<2>(2 * c.first);
        double mass = problem.inertia[static_cast<std::size_t>(c.first)];
        if (c.second >= 0) {
            u -= v.segment<2>(2 * c.second);
            const double other = problem.inertia[static_cast<std::size_t>(c.second)];
            mass = mass * other / (mass + other);
        }
        const auto i = 2 * static_cast<Eigen::Index>(k);
        left.segment<2>(2 * c.first) -= p[i] * n + p[i + 1] * t;
        if (c.second >= 0) left.segment<2>(2 * c.second) += p[i] * n + p[i + 1] * t;
        double slip = t.dot(u);
        for (const int edge : c.edges) {
            if (edge < 0) continue;
            slip -= v[edge];
            left[edge] += p[i + 1];
        }
        const double bound = c.friction * p[i];
        EXPECT_GE(p[i], 0);
        EXPECT_LE(std::abs(p[i + 1]), bound * (1 + 1e-15) + 1e-300);
        const double normal = std::min(n.dot(u), p[i] / mass);
        // Sliding against the friction, or no sliding where it is below its bound.
        const double room = (bound - std::copysign(1.0, -slip) * p[i + 1]) / mass;
        worst.law = std::max({worst.law, std::abs(normal), std::min(std::abs(slip), room)});
    }
    worst.momentum = left.lpNorm<Eigen::Infinity>();
    return worst;
}

/// Solves random systems of blocks of N x N, diagonally dominant, so that no pivots between blocks
/// are needed; against a dense solver.
template <std::size_t N>
void solve_random_blocks()
{
    constexpr auto n = static_cast<Eigen::Index>(N);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> part(-1, 1);
    for (const int count : {1, 2, 7, 40}) {
        std::vector<std::array<int, 2>> pairs;
        for (int i = 0; i < 2 * count && count > 1; ++i) {
            const int a = static_cast<int>(random() % static_cast<unsigned>(count));
            const int b = static_cast<int>(random() % static_cast<unsigned>(count));
            if (a != b) pairs.push_back({a, b});
        }
        BlockLu<N> lu;
        lu.analyze(count, pairs);
        lu.clear();
        Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(n * count, n * count);
        const auto place = [&](int i, Eigen::Index c) {
            return c < 2 ? 2 * i + c : Eigen::Index{2} * count + i;
        };
        const auto add = [&](int i, int j, double sign, const typename BlockLu<N>::Block& b) {
            for (Eigen::Index k = 0; k < n * n; ++k) {
                dense(place(i, k / n), place(j, k % n)) += sign * b[static_cast<std::size_t>(k)];
            }
        };
        const auto draw = [&](double diagonal) {
            typename BlockLu<N>::Block block;
            for (std::size_t k = 0; k < block.size(); ++k) {
                block[k] = part(random) + (k % (N + 1) == 0 ? diagonal : 0);
            }
            return block;
        };
        for (int i = 0; i < count; ++i) {
            const auto block = draw(30);
            lu.add(i, block);
            add(i, i, 1, block);
        }
        for (std::size_t k = 0; k < pairs.size(); ++k) {
            const auto both = draw(0);
            lu.subtract(k, both);
            add(pairs[k][0], pairs[k][1], -1, both);
            add(pairs[k][1], pairs[k][0], -1, both);
            const auto above = draw(0);
            lu.add(k, false, above);
            add(pairs[k][0], pairs[k][1], 1, above);
            const auto below = draw(0);
            lu.add(k, true, below);
            add(pairs[k][1], pairs[k][0], 1, below);
        }
        const Eigen::VectorXd right = Eigen::VectorXd::Random(n * count);
        ASSERT_TRUE(lu.factor());
        EXPECT_LE((lu.solve(right) - dense.lu().solve(right)).norm(), 1e-13 * right.norm());
    }
}

TEST(BlockLu, SolvesRandomSparseSystemsOfBlocks)
{
    solve_random_blocks<2>();
    solve_random_blocks<3>();
}

TEST(BlockLu, RefusesASingularBlock)
{
    BlockLu<2> lu;
    lu.analyze(2, {{0, 1}});
    lu.clear();
    lu.add(0, {1, 0, 0, 1});
    lu.add(1, {1, 0, 0, 1});
    lu.subtract(0, {1, 0, 0, 1});  // the second pivot is 1 - 1
    EXPECT_FALSE(lu.factor());
    BlockLu<3> larger;
    larger.analyze(2, {{0, 1}});
    larger.clear();
    for (const int i : {0, 1}) larger.add(i, {1, 0, 0, 0, 1, 0, 0, 0, 1});
    larger.subtract(0, {0, 0, 0, 0, 0, 0, 0, 0, 1});
    EXPECT_FALSE(larger.factor());
}

TEST(ContactLaw, RandomProblemsAreSolvedOrReported)
{
    RandomLaw random(1);
    ContactLaw law;
    int solved = 0;
    int problems = 0;
    for (const int bodies : {1, 2, 5, 12, 20, 40}) {
        // Problems with 120 contacts jam in all directions; half of them are reported as not
        // solved.
        for (int trial = 0; trial < (bodies == 40 ? 4 : 20); ++trial) {
            const LawProblem problem = random.draw(bodies, 1, trial % 4 == 0);
            Eigen::VectorXd p;
            Eigen::VectorXd v;
            const LawReport report = law.solve(problem, p, v);
            EXPECT_EQ(report.converged, report.residual <= 1e-10);
            problems += bodies < 40;
            if (!report.converged) continue;
            solved += bodies < 40;
            const Defect defect = defect_of(problem, p, v);
            // The residual is in units of sqrt(mass), of 10^4 at most from body to body.
            EXPECT_LT(defect.law, 1e-8);
            EXPECT_LT(defect.momentum, 1e-12 * (1 + p.norm() + problem.momentum.norm()));
        }
    }
    EXPECT_GE(solved, problems - 2);
}

TEST(ContactLaw, RandomProblemsOfDiscsThatTurnAreSolvedOrReported)
{
    RandomLaw random(3);
    ContactLaw law;
    int solved = 0;
    int problems = 0;
    for (const int bodies : {1, 2, 5, 12, 20}) {
        for (int trial = 0; trial < 20; ++trial) {
            const LawProblem problem = random.draw_turning(bodies, 1, trial % 4 == 0);
            Eigen::VectorXd p;
            Eigen::VectorXd v;
            const LawReport report = law.solve(problem, p, v);
            EXPECT_EQ(report.converged, report.residual <= 1e-10);
            ++problems;
            if (!report.converged) continue;
            ++solved;
            const Defect defect = defect_of(problem, p, v);
            EXPECT_LT(defect.law, 1e-8);
            EXPECT_LT(defect.momentum, 1e-12 * (1 + p.norm() + problem.momentum.norm()));
        }
    }
    EXPECT_GE(solved, problems - 2);
}

TEST(ContactLaw, SweepsAndTheDenseSolverTurnDiscsLikeNewtonsMethod)
{
    // One disc on a wall, with velocity (1, -1) and without spin, I = m r^2 / 2: without slip it
    // keeps 2/3 of its velocity. Sweeps alone reach that, too.
    LawProblem problem{.inertia = {2}, .turning = {1}};
    problem.contacts = {{.first = 0, .normal = {0, 1}, .friction = 1, .edges = {2, -1}}};
    problem.momentum = Eigen::Vector3d(2, -2, 0);
    const Eigen::Vector3d expected(2.0 / 3, 0, -2.0 / 3);
    ContactLaw law;
    for (const bool sweeps : {false, true}) {
        Eigen::VectorXd p;
        Eigen::VectorXd v;
        const LawReport report =
            sweeps ? law.settle(problem, p, v, 1e-14, false) : law.solve(problem, p, v);
        EXPECT_TRUE(report.converged);
        EXPECT_LT((v - expected).lpNorm<Eigen::Infinity>(), 1e-13);
    }
}

TEST(ContactLaw, WithoutFrictionVelocitiesAreThoseOfTheDenseSolver)
{
    // Velocities are unique, impulses are not. The error is rounding times the factor 1e5 of the
    // impulses.
    RandomLaw random(2);
    ContactLaw law;
    for (const int bodies : {1, 3, 10, 16, 30}) {
        const LawProblem problem = random.draw(bodies, 0, false);
        Eigen::VectorXd p;
        Eigen::VectorXd v;
        const LawReport report = law.solve(problem, p, v);
        ASSERT_TRUE(report.converged);
        EXPECT_FALSE(report.dense);
        const auto contacts = static_cast<Eigen::Index>(problem.contacts.size());
        Eigen::MatrixXd h = Eigen::MatrixXd::Zero(2 * contacts, 2 * bodies);
        for (Eigen::Index k = 0; k < contacts; ++k) {
            const LawContact& c = problem.contacts[static_cast<std::size_t>(k)];
            const Eigen::Matrix2d rows{{c.normal[0], c.normal[1]}, {-c.normal[1], c.normal[0]}};
            h.block<2, 2>(2 * k, 2 * c.first) += rows;
            if (c.second >= 0) h.block<2, 2>(2 * k, 2 * c.second) -= rows;
        }
        Eigen::VectorXd inverse(2 * bodies);
        for (Eigen::Index i = 0; i < 2 * bodies; ++i) {
            inverse[i] = 1 / problem.inertia[static_cast<std::size_t>(i / 2)];
        }
        const Eigen::MatrixXd w = h * inverse.asDiagonal() * h.transpose();
        const Eigen::VectorXd free = inverse.cwiseProduct(problem.momentum);
        const std::vector<double> friction(problem.contacts.size(), 0.0);
        Eigen::VectorXd dense = Eigen::VectorXd::Zero(2 * contacts);
        ContactSolver solver({.tolerance = 1e-12});
        if (!solver.solve(w, h * free, friction, 2, dense).converged) continue;
        const Eigen::VectorXd expected = free + inverse.cwiseProduct(h.transpose() * dense);
        EXPECT_LT((v - expected).lpNorm<Eigen::Infinity>(), 1e-8);
    }
}

}  // namespace
}  // namespace ricochet::detail::contact_law_test
