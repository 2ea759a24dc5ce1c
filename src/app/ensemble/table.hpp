// Tables of parameters and starts, from a file or at random.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "../registry.hpp"

namespace ricochet::app {

/// Target of a column of a table: a parameter, a component of the state at the start, or an option
/// of the run.
struct Column {
    std::string name;
    std::string unit;
    bool parameter = true;
    std::size_t index = 0;    ///< in the system's parameters or state, or in the options
    bool is_option = false;   ///< else a parameter or a component
    std::string target = {};  ///< of a scene: the place in its file
};

/// Options that a column may set, as on the command line; `id` sets nothing.
struct OptionColumn {
    std::string_view name;
    std::string_view unit;
};
inline constexpr std::array<OptionColumn, 8> option_columns{{{"t-start", "s"},
                                                             {"t-end", "s"},
                                                             {"rtol", ""},
                                                             {"atol", ""},
                                                             {"step", "s"},
                                                             {"event-tolerance", "s"},
                                                             {"max-steps", ""},
                                                             {"id", ""}}};

/// What the columns of a table may be.
struct ColumnSource {
    /// The column of a name. @throws BadInput, with `where`, naming the nearest name.
    std::function<Column(std::string_view where, std::string_view name)> column;
    /// @throws BadInput, with `where`, for a value outside the range of a column.
    std::function<void(const Column& column, double value, std::string_view where)> check;
};
/// Parameters of a system, components of its state, and options of its runs.
[[nodiscard]] ColumnSource columns_of(const SystemEntry& system);

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
/// Values are not checked: one outside its range fails its row.
/// @throws BadInput naming line and column.
[[nodiscard]] Table read_table(const ColumnSource& source, const std::filesystem::path& file);

/// Rows of numbers on a grid and at random: `repeats` times all combinations of the values of
/// `grid`, the first of which changes fastest. A row's random numbers depend only on the seed and
/// its index.
/// @param grid  such as "height=1:10:4", four values from 1 to 10; "height=1:1000:4:log": with
/// equal
///              ratios
/// @param vary  such as "height=1:10", uniform; "height=1:10:log", log-uniform;
///              "height=5:2:normal", with this mean and standard deviation
/// @throws BadInput
[[nodiscard]] Table made_table(const ColumnSource& source, const std::vector<std::string>& grid,
                               const std::vector<std::string>& vary, std::size_t repeats,
                               std::uint64_t seed);

/// Sixty-four bits that depend on all bytes (FNV-1a, and a mixing at the end).
[[nodiscard]] std::uint64_t checksum(std::string_view bytes, std::uint64_t seed = 0) noexcept;

}  // namespace ricochet::app
