// Lists as text.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet::app {

[[nodiscard]] std::string joined(const std::vector<std::string>& parts, std::string_view separator);
[[nodiscard]] std::string joined(const std::vector<std::string_view>& parts,
                                 std::string_view separator);
[[nodiscard]] std::string joined(std::span<const double> numbers, std::string_view separator);

}  // namespace ricochet::app
