#include "input.hpp"
#include "joined.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

namespace ricochet::app {

BadInput unknown(std::string_view what, std::string_view given,
                 const std::vector<std::string_view>& known)
{
    if (known.empty()) {
        return BadInput(fmt::format("unknown {} '{}'; there is none", what, shortened(given)));
    }
    return BadInput(fmt::format("unknown {} '{}'; known {} {}", what, shortened(given),
                                known.size() == 1 ? "is" : "are", joined(known, ", ")));
}

std::string printable(std::string_view text)
{
    std::string out(text);
    std::replace_if(
        out.begin(), out.end(),
        [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == '\x7f'; }, '?');
    return out;
}

std::string shortened(std::string_view text)
{
    constexpr std::size_t most = 200;
    if (text.size() <= most) return std::string(text);
    return fmt::format("{}... ({} characters)", text.substr(0, most), text.size());
}

double number(std::string_view option, std::string_view text)
{
    std::string_view digits = text;
    if (digits.starts_with('+')) digits.remove_prefix(1);
    double value = 0;
    const char* const end = digits.data() + digits.size();
    const auto [stop, error] = std::from_chars(digits.data(), end, value);
    const bool out_of_range = error == std::errc::result_out_of_range;
    if (stop != end || digits.empty() || (error != std::errc() && !out_of_range)) {
        throw BadInput(fmt::format("{} must be a number, got '{}'", option, shortened(text)));
    }
    if (out_of_range || !std::isfinite(value)) {
        throw BadInput(fmt::format("{} must be a finite number, got {}", option, shortened(text)));
    }
    return value;
}

std::uint64_t whole_number(std::string_view option, std::string_view text, std::uint64_t lowest,
                           std::uint64_t highest)
{
    std::uint64_t value = 0;
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, value);
    if (stop != end || error != std::errc() || value < lowest || value > highest) {
        throw BadInput(fmt::format("{} must be a whole number from {} to {}, got '{}'", option,
                                   lowest, highest, shortened(text)));
    }
    return value;
}

Assignment assignment(std::string_view option, std::string_view text)
{
    const std::size_t equals = text.find('=');
    if (equals == std::string_view::npos || equals == 0) {
        throw BadInput(fmt::format("{} must be name=value, got '{}'", option, shortened(text)));
    }
    const std::string name(text.substr(0, equals));
    return {.name = name, .value = number(name, text.substr(equals + 1))};
}

}  // namespace ricochet::app
