#include "ricochet/nonsmooth/detail/any_inclusion.hpp"

#include <fmt/format.h>

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

}  // namespace ricochet::detail
