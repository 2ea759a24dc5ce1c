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

/// A cell of a table of comma-separated values, in quotes where its text needs them.
[[nodiscard]] std::string csv_cell(std::string_view text);

}  // namespace ricochet::app
