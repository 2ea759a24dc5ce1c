// Tables of parameters and starts, from a file or at random.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "../registry.hpp"

namespace ricochet::app {

/// Target of a column of a table: a parameter, or a component of the state at the start.
struct Column {
    std::string name;
    std::string unit;
    bool parameter = true;
    std::size_t index = 0;  ///< in the system's parameters or state
};

/// Rows of numbers for the columns.
struct Table {
    std::vector<Column> columns;
    std::size_t rows = 0;
    std::function<double(std::size_t row, std::size_t column)> value;
    std::string identity;  ///< equal for equal numbers, and different for others except by chance
};

/// The column of that name. A component that a parameter of another name sets is that parameter.
/// @param where  for messages
/// @throws BadInput naming the nearest name.
[[nodiscard]] Column column_named(const SystemEntry& system, std::string_view where,
                                  std::string_view name);

/// Comma-separated values: names in the first line, with or without their units in brackets; empty
/// lines and lines that begin with # are skipped.
/// @throws BadInput naming line and column.
[[nodiscard]] Table read_table(const SystemEntry& system, const std::filesystem::path& file);

/// Rows in which every column is uniform in an interval. A row's numbers depend only on the seed
/// and its index.
/// @param vary  such as "height=1:10"
/// @throws BadInput
[[nodiscard]] Table random_table(const SystemEntry& system, const std::vector<std::string>& vary,
                                 std::size_t rows, std::uint64_t seed);

/// Sixty-four bits that depend on all bytes (FNV-1a, and a mixing at the end).
[[nodiscard]] std::uint64_t checksum(std::string_view bytes, std::uint64_t seed = 0) noexcept;

}  // namespace ricochet::app
