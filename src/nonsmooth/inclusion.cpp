#include "ricochet/detail/any_inclusion.hpp"

#include <fmt/format.h>

namespace ricochet::detail {

void refuse_inclusion(std::string_view what)
{
    throw std::invalid_argument(fmt::format("inclusion: {}", what));
}

void refuse_inclusion(std::string_view what, double given)
{
    throw std::invalid_argument(fmt::format("inclusion: {} {}", what, given));
}

Eigen::Index invert(const Eigen::MatrixXd& a, Eigen::MatrixXd& inverse)
{
    const Eigen::FullPivLU<Eigen::MatrixXd> lu(a);
    const Eigen::Index rank = lu.rank();
    if (rank == a.cols()) inverse = lu.inverse();
    return rank;
}

}  // namespace ricochet::detail
