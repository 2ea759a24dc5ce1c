#include "ricochet/systems/least_eigenvalue.hpp"

#include <Eigen/Eigenvalues>
#include <limits>
#include <numbers>

#include "random.hpp"
#include "require.hpp"
#include "ricochet/systems/opaque.hpp"

namespace ricochet {

namespace {

constexpr int n = static_cast<int>(LeastEigenvalue::order);
using Matrix = Eigen::Matrix<double, n, n>;
using Solver = Eigen::SelfAdjointEigenSolver<Matrix>;

Matrix random_symmetric(double size, detail::Random& random)
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
};

LeastEigenvalue::LeastEigenvalue(const Parameters& parameters) : p_(parameters)
{
    constexpr std::string_view self = "LeastEigenvalue";
    detail::require_finite(self, "level", p_.level);
    detail::require_positive(self, "amplitude", p_.amplitude);
    detail::require_positive(self, "frequency", p_.frequency);
    detail::require(p_.slow >= 0 && p_.slow <= 1, self, "slow", "lie in [0, 1] s", p_.slow);

    detail::Random random(p_.seed);
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
    matrices_ = std::make_shared<const Matrices>(matrices);
}

LeastEigenvalue::State LeastEigenvalue::start() const noexcept
{
    State q{};
    for (std::size_t k = 0; k < 4; ++k) q[k] = p_.amplitude * std::sin(phase_[k]);
    return q;
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
