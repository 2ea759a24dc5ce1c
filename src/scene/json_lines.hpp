// Finds the line of a value in a JSON text.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace ricochet::detail {

/// Keys and indices that lead to a value.
using JsonPath = std::vector<std::variant<std::string, std::size_t>>;

/// The line, counted from 1, of the byte.
[[nodiscard]] std::size_t line_of_byte(std::string_view text, std::size_t byte);

/// The line on which the value at `path` begins, or else the last part of the path that exists, in
/// a text that is valid JSON.
[[nodiscard]] std::size_t line_of(std::string_view text, const JsonPath& path);

/// The line of the second of two equal keys of one object; 0 where there is none.
[[nodiscard]] std::size_t line_of_repeated(std::string_view text, std::string_view key);

/// The line on which more than `levels` lists and objects are open.
[[nodiscard]] std::size_t line_of_depth(std::string_view text, int levels);

/// The line of the first number that is too large for a double.
[[nodiscard]] std::size_t line_of_large_number(std::string_view text);

}  // namespace ricochet::detail
