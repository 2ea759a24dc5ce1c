// Strict reading of typed input: one sentence names the value given and the value
// expected.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet::app {

/// Error in the user's input. Ends the command with status 2; nothing is written.
class BadInput : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// "unknown `what` 'given'; known are ..."
[[nodiscard]] BadInput unknown(std::string_view what, std::string_view given,
                               const std::vector<std::string_view>& known);

/// Replaces bytes on which a terminal would act, as a foreign file may hold, by '?'.
[[nodiscard]] std::string printable(std::string_view text);

/// The text, or its start if it is too long for a sentence.
[[nodiscard]] std::string shortened(std::string_view text);

/// The finite number that `text` spells.
/// @throws BadInput naming the option.
[[nodiscard]] double number(std::string_view option, std::string_view text);

/// The whole number that `text` spells, in [lowest, highest].
/// @throws BadInput naming the option.
[[nodiscard]] std::uint64_t whole_number(std::string_view option, std::string_view text,
                                         std::uint64_t lowest, std::uint64_t highest);

/// The parts of "name=value".
struct Assignment {
    std::string name;
    double value = 0;
};

/// @throws BadInput unless `text` is name=value with a finite value.
[[nodiscard]] Assignment assignment(std::string_view option, std::string_view text);

}  // namespace ricochet::app
