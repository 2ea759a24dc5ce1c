#include "ricochet/nonsmooth/detail/any_inclusion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace ricochet::detail {

void refuse_inclusion(std::string_view what)
{
    throw InclusionRefused(fmt::format("inclusion: {}", what));
}

void refuse_inclusion(std::string_view what, double given)
{
    throw InclusionRefused(fmt::format("inclusion: {} {}", what, given));
}

namespace {

/// Whether the diagonal is positive, of comparable size, and all else zero.
bool is_plainly_diagonal(const Eigen::MatrixXd& a)
{
    if (a.size() == 0 || !a.allFinite() || !a.isDiagonal(0)) return false;
    return a.diagonal().minCoeff() > 1e-12 * a.diagonal().maxCoeff();
}

}  // namespace

Eigen::Index invert(const Eigen::MatrixXd& a, Eigen::MatrixXd& inverse)
{
    if (is_plainly_diagonal(a)) {
        // The same bits as by elimination, without its allocations.
        inverse = a;
        inverse.diagonal() = a.diagonal().cwiseInverse();
        return a.cols();
    }
    const Eigen::FullPivLU<Eigen::MatrixXd> lu(a);
    const Eigen::Index rank = lu.rank();
    if (rank == a.cols()) inverse = lu.inverse();
    return rank;
}

void project_part(PartLaw law, double bound, std::span<const double> given,
                  std::span<const double> z, std::span<double> p)
{
    const std::span<const double> from = law == PartLaw::given ? given : z;
    std::copy(from.begin(), from.end(), p.begin());
    if (law != PartLaw::within_static) return;
    Eigen::Map<Eigen::VectorXd> part(p.data(), static_cast<Eigen::Index>(p.size()));
    const double length = part.stableNorm();
    if (length > bound) part *= bound / length;
}

void part_derivative(PartLaw law, double bound, std::span<const double> z, std::size_t first,
                     std::size_t count, std::span<double> matrix)
{
    const auto row = [&](std::size_t i) { return matrix.subspan((first + i) * count, count); };
    double square = 0;
    for (const double component : z) square += component * component;
    const double length = std::sqrt(square);
    const bool outside = law == PartLaw::within_static && length > bound;
    for (std::size_t i = 0; i < z.size(); ++i) {
        std::fill(row(i).begin(), row(i).end(), 0.0);
        if (law == PartLaw::given) continue;
        row(i)[first + i] = 1;
        for (std::size_t j = 0; j < z.size() && outside; ++j) {
            double& slope = row(i)[first + j];
            slope = bound / length * (slope - (z[i] / length) * (z[j] / length));
        }
    }
}

}  // namespace ricochet::detail
