#include "table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "../input.hpp"
#include "../joined.hpp"
#include "base/read_file.hpp"
#include "ricochet/base/detail/splitmix.hpp"
#include "ricochet/ensemble.hpp"

namespace ricochet::app {

namespace {

/// Number of letters to insert, omit or change to turn one word into the other.
std::size_t distance(std::string_view a, std::string_view b)
{
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < a.size(); ++i) {
        std::size_t diagonal = std::exchange(row[0], i + 1);
        for (std::size_t j = 0; j < b.size(); ++j) {
            const std::size_t changed = diagonal + (a[i] != b[j]);
            diagonal = std::exchange(row[j + 1], std::min({row[j] + 1, row[j + 1] + 1, changed}));
        }
    }
    return row.back();
}

std::string_view trimmed(std::string_view text)
{
    constexpr std::string_view blank = " \t\r";
    const std::size_t first = text.find_first_not_of(blank);
    if (first == std::string_view::npos) return {};
    text = text.substr(first, text.find_last_not_of(blank) - first + 1);
    if (text.size() > 1 && text.front() == '"' && text.back() == '"') {
        return trimmed(text.substr(1, text.size() - 2));
    }
    return text;
}

std::vector<std::string_view> cells(std::string_view line)
{
    std::vector<std::string_view> out;
    for (std::size_t comma = 0; comma != std::string_view::npos;) {
        comma = line.find(',');
        out.push_back(trimmed(line.substr(0, comma)));
        if (comma != std::string_view::npos) line.remove_prefix(comma + 1);
    }
    return out;
}

/// The parameter that sets the start of component i, and nothing else, if there is one.
std::optional<std::size_t> parameter_of(const SystemEntry& system, std::size_t component)
{
    std::vector<double> values;
    for (const Parameter& parameter : system.parameters) values.push_back(parameter.initial);
    const std::vector<double> base = system.start(values);
    for (std::size_t p = 0; p < values.size(); ++p) {
        std::vector<double> other = values;
        for (const double value : {1.25 * values[p] + 0.125, 0.75 * values[p]}) {
            if (value == values[p] || !system.parameters[p].range.contains(value)) continue;
            other[p] = value;
            std::vector<double> start;
            try {
                start = system.start(other);
            } catch (const std::exception&) {
                continue;  // the parameters are incompatible
            }
            if (start.size() != base.size() || start[component] != value) break;
            start[component] = base[component];
            if (start == base) return p;
            break;
        }
    }
    return std::nullopt;
}

[[noreturn]] void refuse_name(const SystemEntry& system, std::string_view where,
                              std::string_view name)
{
    std::vector<std::string_view> known;
    for (const Parameter& parameter : system.parameters) known.push_back(parameter.name);
    for (const Component& component : system.state) {
        if (std::find(known.begin(), known.end(), component.name) == known.end()) {
            known.push_back(component.name);
        }
    }
    const auto nearest = std::min_element(known.begin(), known.end(), [&](auto a, auto b) {
        return distance(a, name) < distance(b, name);
    });
    throw BadInput(fmt::format(
        "{}: '{}' is no parameter or state component of {}; the nearest is {}, known are {}", where,
        shortened(name), system.name, *nearest, joined(known, ", ")));
}

void refuse_twins(const std::vector<Column>& columns, const Column& column, std::string_view where)
{
    for (const Column& other : columns) {
        if (other.parameter != column.parameter || other.index != column.index) continue;
        const std::string both = other.name == column.name
                                     ? other.name
                                     : fmt::format("{}, which is {}", column.name, other.name);
        throw BadInput(fmt::format("{}: there is a column of {} already", where, both));
    }
}

void check_range(const SystemEntry& system, const Column& column, double value,
                 std::string_view where)
{
    if (!column.parameter) return;
    const Parameter& parameter = system.parameters[column.index];
    if (parameter.range.contains(value)) return;
    throw BadInput(fmt::format("{}: {} of {} must lie in {}{}, got {}", where, column.name,
                               system.name, to_string(parameter.range),
                               parameter.unit == "1" ? "" : fmt::format(" {}", parameter.unit),
                               value));
}

std::string bytes_of(const std::vector<double>& numbers)
{
    return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(double)};
}

/// Reads a table line by line.
class TableReader {
public:
    TableReader(const SystemEntry& system, std::string file)
        : system_(system), file_(std::move(file))
    {
    }

    void take(std::size_t number, std::string_view text)
    {
        const std::string_view line = trimmed(text);
        if (line.empty() || line.front() == '#') return;
        // An empty cell after a trailing comma counts; blanks at the ends do not.
        columns_.empty() ? take_names(number, text) : take_numbers(number, text);
    }

    [[nodiscard]] Table table()
    {
        if (columns_.empty()) {
            throw BadInput(fmt::format("the table '{}' is empty, expected a line of names", file_));
        }
        if (numbers_.empty()) {
            throw BadInput(fmt::format("the table '{}' has no rows below its names", file_));
        }
        const std::size_t width = columns_.size();
        Table out{.columns = std::move(columns_),
                  .rows = numbers_.size() / width,
                  .value = {},
                  .identity = fmt::format("{:016x}", checksum(bytes_of(numbers_)))};
        const auto numbers = std::make_shared<std::vector<double>>(std::move(numbers_));
        out.value = [numbers, width](std::size_t row, std::size_t column) {
            return (*numbers)[row * width + column];
        };
        return out;
    }

private:
    [[nodiscard]] std::string where(std::size_t line, std::size_t column) const
    {
        return fmt::format("'{}', line {}, column {}", shortened(file_), line, column + 1);
    }

    void take_names(std::size_t line, std::string_view text)
    {
        for (const std::string_view cell : cells(text)) {
            const std::string here = where(line, columns_.size());
            const std::size_t bracket = cell.ends_with(']') ? cell.rfind('[') : cell.npos;
            const std::string_view name = trimmed(cell.substr(0, bracket));
            Column column = column_named(system_, here, name);
            if (bracket != cell.npos) {
                const auto unit = cell.substr(bracket + 1, cell.size() - bracket - 2);
                if (trimmed(unit) != column.unit) {
                    throw BadInput(fmt::format("{}: {} is in '{}', expected '{}'", here, name,
                                               shortened(unit), column.unit));
                }
            }
            refuse_twins(columns_, column, here);
            columns_.push_back(std::move(column));
        }
    }

    void take_numbers(std::size_t line, std::string_view text)
    {
        const std::vector<std::string_view> row = cells(text);
        if (row.size() != columns_.size()) {
            throw BadInput(fmt::format("'{}', line {}: found {} number{}, expected {}",
                                       shortened(file_), line, row.size(),
                                       row.size() == 1 ? "" : "s", columns_.size()));
        }
        for (std::size_t i = 0; i < row.size(); ++i) {
            const std::string here = where(line, i);
            const double value = number(fmt::format("{}: {}", here, columns_[i].name), row[i]);
            check_range(system_, columns_[i], value, here);
            numbers_.push_back(value);
        }
    }

    const SystemEntry& system_;
    std::string file_;
    std::vector<Column> columns_;
    std::vector<double> numbers_;
};

}  // namespace

std::uint64_t checksum(std::string_view bytes, std::uint64_t seed) noexcept
{
    std::uint64_t hash = 0xcbf29ce484222325U ^ seed;
    for (const char byte : bytes) {
        hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
    }
    return ricochet::detail::SplitMix(hash).bits();
}

Column column_named(const SystemEntry& system, std::string_view where, std::string_view name)
{
    for (std::size_t i = 0; i < system.parameters.size(); ++i) {
        const Parameter& parameter = system.parameters[i];
        if (parameter.name != name) continue;
        return {.name = std::string(name),
                .unit = std::string(parameter.unit),
                .parameter = true,
                .index = i};
    }
    for (std::size_t i = 0; i < system.state.size(); ++i) {
        const Component& component = system.state[i];
        if (component.name != name) continue;
        const std::optional<std::size_t> parameter = parameter_of(system, i);
        if (!parameter && system.start_mode != nullptr) {
            throw BadInput(fmt::format(
                "{}: the mode of {} at the start follows from its parameters, and {} is "
                "none of these",
                where, system.name, name));
        }
        return {.name = std::string(name),
                .unit = std::string(component.unit),
                .parameter = parameter.has_value(),
                .index = parameter.value_or(i)};
    }
    refuse_name(system, where, name);
}

Table read_table(const SystemEntry& system, const std::filesystem::path& file)
{
    const std::string content = ricochet::detail::read_file(file, [&](const std::string& why) {
        throw BadInput(
            fmt::format("the table '{}' cannot be read: {}", shortened(file.string()), why));
    });
    std::string_view rest = content;
    if (rest.starts_with("\xef\xbb\xbf")) rest.remove_prefix(3);  // a byte order mark
    TableReader reader(system, file.string());
    for (std::size_t line = 1; !rest.empty(); ++line) {
        const std::size_t end = rest.find('\n');
        reader.take(line, rest.substr(0, end));
        rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    }
    return reader.table();
}

Table random_table(const SystemEntry& system, const std::vector<std::string>& vary,
                   std::size_t rows, std::uint64_t seed)
{
    Table out{.columns = {}, .rows = rows, .value = {}, .identity = {}};
    std::vector<std::pair<double, double>> bounds;
    out.identity = fmt::format("seed {}", seed);
    for (const std::string& text : vary) {
        const std::size_t equals = text.find('=');
        const std::size_t colon = text.find(':', equals == text.npos ? 0 : equals);
        if (equals == text.npos || equals == 0 || colon == text.npos) {
            throw BadInput(
                fmt::format("--vary must be name=lowest:highest, got '{}'", shortened(text)));
        }
        const std::string where = fmt::format("--vary {}", shortened(text));
        Column column = column_named(system, where, text.substr(0, equals));
        refuse_twins(out.columns, column, where);
        const double lowest = number(where, text.substr(equals + 1, colon - equals - 1));
        const double highest = number(where, text.substr(colon + 1));
        if (!(lowest <= highest)) {
            throw BadInput(fmt::format("{}: the lowest value is above the highest", where));
        }
        check_range(system, column, lowest, where);
        check_range(system, column, highest, where);
        bounds.emplace_back(lowest, highest);
        out.identity += fmt::format(", {}={}:{}", column.name, lowest, highest);
        out.columns.push_back(std::move(column));
    }
    out.value = [bounds, seed](std::size_t row, std::size_t column) {
        const std::uint64_t own = row_seed(row_seed(seed, row), column);
        const auto [lowest, highest] = bounds[column];
        return ricochet::detail::SplitMix(own).uniform(lowest, highest);
    };
    return out;
}

}  // namespace ricochet::app
