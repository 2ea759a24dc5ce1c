#include "ricochet/run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>

#include "base/require.hpp"

namespace ricochet {

namespace {

constexpr std::string_view heading = "ricochet-snapshot 2";
constexpr std::string_view between = " = ";
constexpr std::string_view last_line = "checksum ";

constexpr detail::Refuse refuse_snapshot{"snapshot"};

/// The last line: 64 bits that change with the text (Fowler, Noll and Vo's hash, 1a).
std::string checksum(std::string_view text)
{
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (const char c : text) {
        hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    }
    return fmt::format("{}{:016x}\n", last_line, hash);
}

/// Takes the text up to the next line break, and the break, off the front.
std::string_view next_line(std::string_view& text)
{
    const auto stop = text.find('\n');
    if (stop == std::string_view::npos) refuse_snapshot("the text ends in the middle of a line");
    const std::string_view line = text.substr(0, stop);
    text.remove_prefix(stop + 1);
    return line;
}

template <class T>
T parse(std::string_view word, auto... format)
{
    T value{};
    const auto [end, error] =
        std::from_chars(word.data(), word.data() + word.size(), value, format...);
    if (word.empty() || error != std::errc() || end != word.data() + word.size()) {
        refuse_snapshot(fmt::format("expected a number, got \"{}\"", word.substr(0, 40)));
    }
    return value;
}

/// Takes the word up to the next space, and the space, off the front.
std::string_view next_word(std::string_view& line)
{
    const auto stop = std::min(line.find(' '), line.size());
    const std::string_view word = line.substr(0, stop);
    line.remove_prefix(std::min(stop + 1, line.size()));
    return word;
}

/// A text on one line.
std::string on_one_line(std::string text)
{
    std::replace_if(
        text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
    return text;
}

}  // namespace

std::string to_text(const Snapshot& snapshot)
{
    std::string text = fmt::format("{} {} {} {}\n", heading, snapshot.run.size(),
                                   snapshot.numbers.size(), snapshot.counts.size());
    for (const RunProperty& property : snapshot.run) {
        text += property.name;
        text += between;
        text += on_one_line(property.value);
        text += '\n';
    }
    std::array<char, 40> buffer;
    for (const double number : snapshot.numbers) {
        const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number,
                                       std::chars_format::hex);
        text.append(buffer.data(), end.ptr);
        text += '\n';
    }
    for (const std::uint64_t count : snapshot.counts) text += fmt::format("{}\n", count);
    return text + checksum(text);
}

Snapshot snapshot_from_text(std::string_view text)
{
    if (text.starts_with("ricochet-snapshot 1 ")) {
        refuse_snapshot(
            "it was written by an earlier version, which did not say of which run it is");
    }
    if (!text.starts_with(heading)) {
        refuse_snapshot(fmt::format("expected \"{}\", got \"{}\"", heading, text.substr(0, 40)));
    }
    const auto end = std::min(text.rfind(last_line), text.size());
    if (text.substr(end) != checksum(text.substr(0, end))) {
        refuse_snapshot("the text was changed or cut after it was written: its checksum differs");
    }
    text = text.substr(heading.size(), end - heading.size());
    std::string_view sizes = next_line(text);
    if (!next_word(sizes).empty()) refuse_snapshot("another version wrote it");
    const auto properties = parse<std::size_t>(next_word(sizes));
    const auto numbers = parse<std::size_t>(next_word(sizes));
    const auto counts = parse<std::size_t>(sizes);
    Snapshot snapshot;
    for (std::size_t i = 0; i < properties; ++i) {
        const std::string_view line = next_line(text);
        const auto at = line.find(between);
        if (at == std::string_view::npos) refuse_snapshot("expected a property of the run");
        snapshot.run.push_back(
            {std::string(line.substr(0, at)), std::string(line.substr(at + between.size()))});
    }
    for (std::size_t i = 0; i < numbers; ++i) {
        snapshot.numbers.push_back(parse<double>(next_line(text), std::chars_format::hex));
    }
    for (std::size_t i = 0; i < counts; ++i) {
        snapshot.counts.push_back(parse<std::uint64_t>(next_line(text)));
    }
    if (!text.empty()) refuse_snapshot("its text is longer than it says");
    return snapshot;
}

namespace detail {

void throw_snapshot_does_not_fit()
{
    refuse_snapshot("it was saved by a simulation with another number of guards or components");
}

void throw_snapshot_is_no_state(std::string_view what)
{
    refuse_snapshot(fmt::format("{} has a value that it has in no run of this kind", what));
}

void throw_snapshot_later(double t, double t_end)
{
    refuse_snapshot(fmt::format("it is of t = {}, later than t_end = {} of this run", t, t_end));
}

std::string plain_type_name(std::string_view written)
{
    // "... [with T = X]" by GCC, "... [T = X]" by Clang.
    constexpr std::string_view before = "T = ";
    const auto start = written.find(before);
    const auto stop = written.rfind(']');
    if (start != std::string_view::npos && stop != std::string_view::npos) {
        written = written.substr(start + before.size(), stop - start - before.size());
    }
    // The qualification before a :: is dropped, back to the start of this name.
    std::string out;
    std::vector<std::size_t> begins{0};
    int parentheses = 0;
    for (std::size_t i = 0; i < written.size(); ++i) {
        const char c = written[i];
        parentheses += (c == '(') - (c == ')');
        if (parentheses == 0 && written.substr(i, 2) == "::") {
            out.resize(begins.back());
            ++i;
            continue;
        }
        out += c;
        if (parentheses > 0) continue;
        if (c == '>' && out.ends_with(" >")) out.erase(out.size() - 2, 1);
        if (c == '<') begins.push_back(out.size());
        if (c == '>' && begins.size() > 1) begins.pop_back();
        if (c == ',' || c == ' ') begins.back() = out.size();
    }
    return out;
}

std::vector<RunProperty> properties_of_run(const RunParts& parts, const Options& o)
{
    const auto text = [](const auto& value) { return fmt::format("{}", value); };
    std::vector<RunProperty> out{
        {"system", on_one_line(parts.system)},
        {"components at the start", text(parts.components)},
        {"number of guards", text(parts.guards)},
        {"stepping", parts.stepping},
        {"detector", parts.detector},
        {"locator", parts.locator},
        {"t_start", text(o.t_start)},
        {"direction", o.t_end < o.t_start ? "backward" : "forward"},
    };
    if (parts.error_controlled) {
        out.push_back({"rtol", text(o.rtol)});
        out.push_back({"atol", text(o.atol)});
        std::string each;
        for (const double atol : o.component_atol) each += text(atol) + ' ';
        if (!each.empty()) out.push_back({"component_atol", each});
        out.push_back({"h_min", text(o.h_min)});
        out.push_back({"h_max", text(o.h_max)});
    } else {
        out.push_back({"step", text(o.step)});
    }
    out.push_back({"event_tolerance", text(o.event_tolerance)});
    out.push_back({"event_rtol", text(o.event_rtol)});
    out.push_back({"event_window", text(o.event_window)});
    out.push_back({"stop_at_event", text(o.stop_at_event)});
    out.push_back({"check_inside", o.check_inside ? "true" : "false"});
    return out;
}

void require_same_run(const std::vector<RunProperty>& saved, const std::vector<RunProperty>& here)
{
    if (saved.empty()) refuse_snapshot("it does not say of which run it is");
    for (std::size_t i = 0; i < std::min(saved.size(), here.size()); ++i) {
        if (saved[i] == here[i]) continue;
        // A text has every property on one line.
        if (saved[i].name == here[i].name &&
            on_one_line(saved[i].value) == on_one_line(here[i].value)) {
            continue;
        }
        // the name of `check_inside` before version 0.2
        if (saved[i].name == "look_inside" && here[i].name == "check_inside" &&
            saved[i].value == here[i].value)
            continue;
        refuse_snapshot(fmt::format("it is of a run with {} = {}, and this one has {} = {}",
                                    saved[i].name, saved[i].value, here[i].name, here[i].value));
    }
    if (saved.size() != here.size())
        refuse_snapshot("it is of a run with other properties than this one");
}

}  // namespace detail

}  // namespace ricochet
