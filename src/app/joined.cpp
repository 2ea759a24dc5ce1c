#include "joined.hpp"

#include <fmt/format.h>

namespace ricochet::app {

namespace {

template <class Parts>
std::string join(const Parts& parts, std::string_view separator)
{
    std::string out;
    std::string_view before;
    for (const auto& part : parts) {
        out += fmt::format("{}{}", before, part);
        before = separator;
    }
    return out;
}

}  // namespace

std::string joined(const std::vector<std::string>& parts, std::string_view separator)
{
    return join(parts, separator);
}

std::string joined(const std::vector<std::string_view>& parts, std::string_view separator)
{
    return join(parts, separator);
}

std::string joined(std::span<const double> numbers, std::string_view separator)
{
    return join(numbers, separator);
}

std::string csv_cell(std::string_view text)
{
    if (text.find_first_of(",\"\n\r") == std::string_view::npos) return std::string(text);
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"') out += '"';
        out += c == '\n' || c == '\r' ? ' ' : c;
    }
    return out + '"';
}

}  // namespace ricochet::app
