#include "problems/least_eigenvalue.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "base/require.hpp"
#include "problems/geometry/concave_table.hpp"
#include "problems/opaque.hpp"
#include "ricochet/base/detail/splitmix.hpp"

namespace ricochet {

namespace {

constexpr int n = static_cast<int>(LeastEigenvalue::order);
using Matrix = Eigen::Matrix<double, n, n>;
using Solver = Eigen::SelfAdjointEigenSolver<Matrix>;

Matrix random_symmetric(double size, detail::SplitMix& random)
{
    Matrix out;
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j <= i; ++j) out(i, j) = out(j, i) = random.uniform(-size, size);
    }
    return out;
}

}  // namespace

struct LeastEigenvalue::Matrices {
    Matrix still;
    std::array<Matrix, 4> by_load;

    [[nodiscard]] Matrix at(const State& q) const noexcept
    {
        Matrix out = still;
        for (std::size_t k = 0; k < 4; ++k) out.noalias() += q[k] * by_load[k];
        return out;
    }

    /// The Rayleigh quotient of any vector is affine in q and bounds the least eigenvalue from
    /// above; that of the eigenvector touches it.
    [[nodiscard]] geometry::Tangent<4> tangent(const State& q) const
    {
        const Matrix here = at(q);
        const Solver solver(here);
        const auto u = solver.eigenvectors().col(0);
        const double squared = u.squaredNorm();
        geometry::Tangent<4> out{.value = u.dot(here * u) / squared};
        for (std::size_t k = 0; k < 4; ++k) out.slope[k] = u.dot(by_load[k] * u) / squared;
        return out;
    }

    geometry::ConcaveTable<4> table;
};

LeastEigenvalue::LeastEigenvalue(const Parameters& parameters) : p_(parameters)
{
    constexpr std::string_view self = "LeastEigenvalue";
    detail::require_finite(self, "level", p_.level);
    detail::require_positive(self, "amplitude", p_.amplitude);
    detail::require_positive(self, "frequency", p_.frequency);
    detail::require(p_.table <= 48, self, "table", "be at most 48 cells",
                    static_cast<double>(p_.table));
    detail::require(p_.slow >= 0 && p_.slow <= 1, self, "slow", "lie in [0, 1] s", p_.slow);

    detail::SplitMix random(p_.seed);
    Matrices matrices;
    // Eigenvalues from 2 to 25, turned by a random rotation.
    const Solver rotation(random_symmetric(1, random));
    Eigen::Matrix<double, n, 1> values;
    for (int i = 0; i < n; ++i) values(i) = 2 + i;
    matrices.still =
        rotation.eigenvectors() * values.asDiagonal() * rotation.eigenvectors().transpose();
    matrices.still = (0.5 * (matrices.still + matrices.still.transpose())).eval();
    for (std::size_t k = 0; k < 4; ++k) {
        matrices.by_load[k] = random_symmetric(0.25, random);
        const Solver solver(matrices.by_load[k], Eigen::EigenvaluesOnly);
        norm_[k] = (1 + 1e-12) * solver.eigenvalues().cwiseAbs().maxCoeff();
        phase_[k] = random.uniform(0, 2 * std::numbers::pi);
    }
    const std::array<double, 4> factors{1, std::numbers::sqrt2, std::numbers::phi,
                                        std::numbers::e / 1.4};
    for (std::size_t k = 0; k < 4; ++k) frequency_[k] = p_.frequency * factors[k];
    if (p_.table > 0) {
        // A little beyond the loads, which are integrated. The solver's error is some n u ||K||
        // = 1e-13 (Golub and Van Loan, "Matrix Computations", 2013, section 8.3).
        geometry::Box<4> box;
        box.lower.fill(-1.001 * p_.amplitude);
        box.upper.fill(1.001 * p_.amplitude);
        const double size = 26 + p_.amplitude * (norm_[0] + norm_[1] + norm_[2] + norm_[3]);
        matrices.table = geometry::ConcaveTable<4>(
            box, p_.table, 1e-13 * size, [&](const State& q) { return matrices.tangent(q); });
    }
    matrices_ = std::make_shared<const Matrices>(std::move(matrices));
}

LeastEigenvalue::State LeastEigenvalue::start() const noexcept
{
    State q{};
    for (std::size_t k = 0; k < 4; ++k) q[k] = p_.amplitude * std::sin(phase_[k]);
    return q;
}

std::size_t LeastEigenvalue::tabulated() const noexcept
{
    return matrices_->table.size();
}

double LeastEigenvalue::least(const State& q) const noexcept
{
    return matrices_->table.lower_bound(q);
}

double LeastEigenvalue::most(const State& q) const noexcept
{
    return matrices_->table.upper_bound(q);
}

double LeastEigenvalue::least_over(const State& lower, const State& upper) const noexcept
{
    double out = std::numeric_limits<double>::infinity();
    for (unsigned corner = 0; corner < 16; ++corner) {
        State q;
        for (std::size_t k = 0; k < 4; ++k) q[k] = (corner >> k & 1U) != 0 ? upper[k] : lower[k];
        const double here = p_.table > 0 ? least(q) : eigenvalue(q) - 1e-11;
        if (std::isnan(here)) return here;
        out = std::min(out, here);
    }
    return out;
}

std::optional<double> LeastEigenvalue::parameter(std::string_view which) const noexcept
{
    if (which == "level") return p_.level;
    if (which == "amplitude") return p_.amplitude;
    if (which == "frequency") return p_.frequency;
    if (which == "seed") return static_cast<double>(p_.seed);
    return std::nullopt;
}

double LeastEigenvalue::eigenvalue(const State& q) const noexcept
{
    detail::wait(p_.slow);
    const Matrix at = matrices_->at(q);
    if (!at.allFinite()) return std::numeric_limits<double>::quiet_NaN();
    return Solver(at, Eigen::EigenvaluesOnly).eigenvalues()(0);
}

double LeastEigenvalue::eigenvalue_rate(const State& q, const State& rates) const noexcept
{
    detail::wait(p_.slow);
    const Matrix at = matrices_->at(q);
    if (!at.allFinite()) return std::numeric_limits<double>::quiet_NaN();
    const Solver solver(at);
    const auto u = solver.eigenvectors().col(0);
    double sum = 0;
    for (std::size_t k = 0; k < 4; ++k) {
        sum += rates[k] * u.dot(matrices_->by_load[k] * u);
    }
    return sum;
}

}  // namespace ricochet
