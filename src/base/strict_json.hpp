// JSON from untrusted files.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <stdexcept>
#include <string_view>

namespace ricochet::detail {

/// Error in a text that should be JSON.
class JsonTrouble : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Error of a text that is nested deeper than its format.
class JsonTooDeep : public JsonTrouble {
public:
    using JsonTrouble::JsonTrouble;
};

/// Parses JSON in which no object has a key twice and nothing is nested deeper than `levels`:
/// nesting of a hundred thousand levels would exhaust the stack of any code that traverses it.
/// @throws JsonTrouble
[[nodiscard]] nlohmann::json parse_strictly(std::string_view text, int levels);

}  // namespace ricochet::detail
