#include "scene/json_lines.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace ricochet::detail {

namespace {

/// Walks through a text that is valid JSON, at least up to where it is cut, without checking it
/// again.
class Walk {
public:
    explicit Walk(std::string_view text) : text_(text) {}

    /// Byte at which the value at `path` begins, or else that of the last part of it that exists.
    std::size_t to(const JsonPath& path)
    {
        path_ = &path;
        value(0);
        return found_;
    }
    /// Byte of the second key of that name in one object.
    std::size_t repeated(std::string_view key)
    {
        wanted_ = key;
        value(none);
        return repeated_;
    }

private:
    static constexpr std::size_t none = std::string_view::npos;
    static constexpr int deepest = 64;

    [[nodiscard]] char here() const { return at_ < text_.size() ? text_[at_] : '\0'; }
    void space()
    {
        while (at_ < text_.size() && std::string_view(" \t\r\n,:").find(here()) != none) ++at_;
    }
    std::string_view string()
    {
        const std::size_t from = ++at_;
        while (at_ < text_.size() && here() != '"') at_ += here() == '\\' ? 2 : 1;
        at_ = std::min(at_, text_.size());
        const std::string_view inside = text_.substr(from, at_ - from);
        ++at_;
        return inside;
    }

    /// The first `depth` parts of the path lead here, or `none` where this is off the path.
    void value(std::size_t depth)
    {
        space();
        if (depth != none) found_ = std::min(at_, text_.size());
        if (here() == '{' || here() == '[') {
            if (++open_ > deepest) {
                at_ = text_.size();
            } else {
                parts(depth, here() == '{');
            }
            --open_;
            return;
        }
        if (here() == '"') {
            string();
            return;
        }
        while (at_ < text_.size() && std::string_view(" \t\r\n,:]}").find(here()) == none) ++at_;
    }

    void parts(std::size_t depth, bool object)
    {
        ++at_;
        bool seen = false;
        for (std::size_t index = 0;; ++index) {
            space();
            if (at_ >= text_.size()) return;
            if (here() == '}' || here() == ']') {
                ++at_;
                return;
            }
            const bool on = depth != none && path_ && depth < path_->size();
            bool leads = false;
            if (object) {
                const std::size_t from = at_;
                const std::string_view key = string();
                if (!path_ && key == wanted_ && std::exchange(seen, true) && repeated_ == 0) {
                    repeated_ = from;
                }
                const auto* part = on ? std::get_if<std::string>(&(*path_)[depth]) : nullptr;
                leads = part && *part == key;
            } else {
                const auto* part = on ? std::get_if<std::size_t>(&(*path_)[depth]) : nullptr;
                leads = part && *part == index;
            }
            value(leads ? depth + 1 : none);
        }
    }

    std::string_view text_;
    std::size_t at_ = 0;
    int open_ = 0;
    const JsonPath* path_ = nullptr;
    std::string_view wanted_;
    std::size_t found_ = 0;
    std::size_t repeated_ = 0;
};

}  // namespace

std::size_t line_of_byte(std::string_view text, std::size_t byte)
{
    const std::string_view head = text.substr(0, std::min(byte, text.size()));
    return 1 + static_cast<std::size_t>(std::ranges::count(head, '\n'));
}

std::size_t line_of(std::string_view text, const JsonPath& path)
{
    return line_of_byte(text, Walk(text).to(path));
}

std::size_t line_of_repeated(std::string_view text, std::string_view key)
{
    const std::size_t byte = Walk(text).repeated(key);
    return byte == 0 ? 0 : line_of_byte(text, byte);
}

namespace {

/// The line of the first byte outside of strings for which `stops(index)` is true, else 1.
template <class Stops>
[[nodiscard]] std::size_t line_outside_strings(std::string_view text, const Stops& stops)
{
    bool inside = false;
    for (std::size_t at = 0; at < text.size(); ++at) {
        const char c = text[at];
        if (inside && c == '\\') {
            ++at;
        } else if (c == '"') {
            inside = !inside;
        } else if (!inside && stops(at)) {
            return line_of_byte(text, at);
        }
    }
    return 1;
}

}  // namespace

std::size_t line_of_depth(std::string_view text, int levels)
{
    return line_outside_strings(text, [&](std::size_t at) {
        const char c = text[at];
        if (c == '{' || c == '[') return levels-- == 0;
        if (c == '}' || c == ']') ++levels;
        return false;
    });
}

std::size_t line_of_large_number(std::string_view text)
{
    constexpr std::string_view of_numbers = "0123456789+-.eE";
    const auto continues = [&](std::size_t at) {
        return at < text.size() && of_numbers.find(text[at]) != std::string_view::npos;
    };
    return line_outside_strings(text, [&](std::size_t at) {
        if (!continues(at) || (at > 0 && continues(at - 1))) return false;
        const std::size_t end = text.find_first_not_of(of_numbers, at);
        return std::isinf(std::strtod(std::string(text.substr(at, end - at)).c_str(), nullptr));
    });
}

}  // namespace ricochet::detail
