#include "ricochet/integrate/snapshot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <stdexcept>

namespace ricochet {

namespace {

constexpr std::string_view heading = "ricochet-snapshot 1";

/// Takes the text up to the next white space off the front.
std::string_view next_word(std::string_view& text)
{
    const auto start = text.find_first_not_of(" \n");
    if (start == std::string_view::npos) return {};
    const auto stop = std::min(text.find_first_of(" \n", start), text.size());
    const std::string_view word = text.substr(start, stop - start);
    text.remove_prefix(stop);
    return word;
}

template <class T>
T parse(std::string_view& text, auto... format)
{
    const std::string_view word = next_word(text);
    T value{};
    const auto [end, error] =
        std::from_chars(word.data(), word.data() + word.size(), value, format...);
    if (word.empty() || error != std::errc() || end != word.data() + word.size()) {
        throw std::invalid_argument(
            fmt::format("snapshot: expected a number, got \"{}\"", word.substr(0, 40)));
    }
    return value;
}

}  // namespace

std::string to_text(const Snapshot& snapshot)
{
    std::string text =
        fmt::format("{} {} {}\n", heading, snapshot.numbers.size(), snapshot.counts.size());
    std::array<char, 40> buffer;
    for (const double number : snapshot.numbers) {
        const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number,
                                       std::chars_format::hex);
        text.append(buffer.data(), end.ptr);
        text += '\n';
    }
    for (const std::uint64_t count : snapshot.counts) text += fmt::format("{}\n", count);
    return text;
}

Snapshot snapshot_from_text(std::string_view text)
{
    if (!text.starts_with(heading)) {
        throw std::invalid_argument(
            fmt::format("snapshot: expected \"{}\", got \"{}\"", heading, text.substr(0, 40)));
    }
    text.remove_prefix(heading.size());
    const auto numbers = parse<std::size_t>(text);
    const auto counts = parse<std::size_t>(text);
    if (numbers > text.size() || counts > text.size()) {
        throw std::invalid_argument("snapshot: the text is shorter than it says");
    }
    Snapshot snapshot;
    for (std::size_t i = 0; i < numbers; ++i) {
        snapshot.numbers.push_back(parse<double>(text, std::chars_format::hex));
    }
    for (std::size_t i = 0; i < counts; ++i) {
        snapshot.counts.push_back(parse<std::uint64_t>(text));
    }
    if (!next_word(text).empty()) {
        throw std::invalid_argument("snapshot: the text is longer than it says");
    }
    return snapshot;
}

void detail::throw_snapshot_does_not_fit()
{
    throw std::invalid_argument(
        "snapshot: it was saved by a simulation with another number of guards or components");
}

}  // namespace ricochet
