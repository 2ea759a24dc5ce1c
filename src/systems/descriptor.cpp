#include "ricochet/systems/descriptor.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace ricochet {

bool ParameterRange::contains(double value) const noexcept
{
    return (lower_included ? value >= lower : value > lower) &&
           (upper_included ? value <= upper : value < upper);
}

std::string to_string(const ParameterRange& range)
{
    return fmt::format("{}{}, {}{}", range.lower_included ? '[' : '(', range.lower, range.upper,
                       range.upper_included ? ']' : ')');
}

void detail::refuse_parameter_count(std::string_view name, std::size_t found, std::size_t expected)
{
    throw std::invalid_argument(
        fmt::format("{}: found {} parameters, expected {}", name, found, expected));
}

}  // namespace ricochet
