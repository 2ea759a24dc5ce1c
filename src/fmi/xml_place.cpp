#include "fmi/xml_place.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <system_error>
#include <utility>

#include "base/read_file.hpp"
#include "ricochet/fmi/fmu.hpp"

namespace ricochet::fmi {

namespace {

constexpr std::uintmax_t longest_description = std::uintmax_t{1} << 28;

constexpr std::string_view blanks = " \t\r\n";

std::string_view trimmed(std::string_view text)
{
    const std::size_t begin = text.find_first_not_of(blanks);
    if (begin == std::string_view::npos) return {};
    return text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

/// A number of XML, which may have a sign +. Not by strtod, which reads what the locale says.
std::optional<double> read_number(std::string_view word)
{
    if (word == "true") return 1;
    if (word == "false") return 0;
    if (word == "INF" || word == "+INF") return std::numeric_limits<double>::infinity();
    if (word == "-INF") return -std::numeric_limits<double>::infinity();
    if (word.size() > 1 && word.front() == '+' && word[1] != '-') word.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (end != word.data() + word.size()) return std::nullopt;
    if (error != std::errc{} && error != std::errc::result_out_of_range) return std::nullopt;
    return value;
}

std::string shown(std::string_view text)
{
    std::string out;
    for (const char c : text.substr(0, 60)) {
        out += static_cast<unsigned char>(c) < ' ' ? '?' : c;
    }
    return text.size() > 60 ? out + "..." : out;
}

}  // namespace

XmlFile::XmlFile(const std::string& path, std::string name) : name_(std::move(name))
{
    bytes_ = ricochet::detail::read_file(
        path, [&](std::string_view why) { throw Error(fmt::format("{}: {}", name_, why)); },
        longest_description);
    const pugi::xml_parse_result parsed = document_.load_buffer(bytes_.data(), bytes_.size());
    if (!parsed) {
        throw Error(
            fmt::format("{}:{}: no XML: {}", name_, line(parsed.offset), parsed.description()));
    }
}

std::size_t XmlFile::line(std::ptrdiff_t offset) const
{
    const auto end = bytes_.begin() + std::clamp<std::ptrdiff_t>(offset, 0, std::ssize(bytes_));
    return static_cast<std::size_t>(std::count(bytes_.begin(), end, '\n')) + 1;
}

void XmlFile::fail(const pugi::xml_node& node, std::string_view what) const
{
    throw Error(
        fmt::format("{}:{}: <{}> {}", name_, line(node.offset_debug()), shown(node.name()), what));
}

std::optional<std::string> XmlFile::text(const pugi::xml_node& node, const char* attribute)
{
    const pugi::xml_attribute found = node.attribute(attribute);
    if (!found) return std::nullopt;
    return found.value();
}

std::string XmlFile::needed(const pugi::xml_node& node, const char* attribute) const
{
    const std::optional<std::string> found = text(node, attribute);
    if (!found) fail(node, fmt::format("has no attribute {}", attribute));
    if (found->empty()) fail(node, fmt::format("has an empty attribute {}", attribute));
    return *found;
}

bool XmlFile::flag(const pugi::xml_node& node, const char* attribute) const
{
    const std::optional<std::string> found = text(node, attribute);
    if (!found) return false;
    const std::string_view word = trimmed(*found);
    if (word == "true" || word == "1") return true;
    if (word != "false" && word != "0") {
        fail(node, fmt::format("has {} = '{}'; expected true or false", attribute, shown(*found)));
    }
    return false;
}

std::optional<double> XmlFile::number(const pugi::xml_node& node, const char* attribute) const
{
    const std::optional<std::string> found = text(node, attribute);
    if (!found) return std::nullopt;
    const std::optional<double> value = read_number(trimmed(*found));
    if (!value) {
        fail(node, fmt::format("has {} = '{}'; expected a number", attribute, shown(*found)));
    }
    return value;
}

std::vector<double> XmlFile::numbers(const pugi::xml_node& node, const char* attribute) const
{
    const std::optional<std::string> found = text(node, attribute);
    if (!found) return {};
    std::vector<double> values;
    std::string_view rest = trimmed(*found);
    while (!rest.empty()) {
        const std::string_view word = rest.substr(0, rest.find_first_of(blanks));
        const std::optional<double> value = read_number(word);
        if (!value) {
            fail(node, fmt::format("has {} = '{}'; expected numbers", attribute, shown(*found)));
        }
        values.push_back(*value);
        rest = trimmed(rest.substr(word.size()));
    }
    return values;
}

std::optional<std::uint64_t> XmlFile::count(const pugi::xml_node& node, const char* attribute,
                                            std::uint64_t most) const
{
    const std::optional<std::string> found = text(node, attribute);
    if (!found) return std::nullopt;
    const std::string_view word = trimmed(*found);
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size() || value > most) {
        fail(node, fmt::format("has {} = '{}'; expected a whole number up to {}", attribute,
                               shown(*found), most));
    }
    return value;
}

std::uint64_t XmlFile::needed_count(const pugi::xml_node& node, const char* attribute,
                                    std::uint64_t most) const
{
    (void)needed(node, attribute);
    return *count(node, attribute, most);
}

std::size_t XmlFile::choice(const pugi::xml_node& node, const char* attribute,
                            const std::vector<std::string_view>& words, std::size_t otherwise) const
{
    const std::optional<std::string> found = text(node, attribute);
    if (!found) return otherwise;
    const auto at = std::ranges::find(words, trimmed(*found));
    if (at == words.end()) {
        fail(node, fmt::format("has {} = '{}'; expected one of {}", attribute, shown(*found),
                               fmt::join(words, ", ")));
    }
    return static_cast<std::size_t>(at - words.begin());
}

}  // namespace ricochet::fmi
