// JSON from files that anybody may have written.
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

/// JSON in which no object has a key twice and nothing lies deeper than `levels`: what is nested a
/// hundred thousand times would exhaust the stack of whatever walks through it.
/// @throws JsonTrouble
[[nodiscard]] nlohmann::json parse_strictly(std::string_view text, int levels);

}  // namespace ricochet::detail
