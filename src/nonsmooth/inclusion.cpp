#include "ricochet/nonsmooth/inclusion.hpp"

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

}  // namespace ricochet::detail
