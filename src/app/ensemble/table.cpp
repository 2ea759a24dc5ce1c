#include "table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
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
    for (const OptionColumn& option : option_columns) known.push_back(option.name);
    const auto nearest = std::min_element(known.begin(), known.end(), [&](auto a, auto b) {
        return distance(a, name) < distance(b, name);
    });
    throw BadInput(
        fmt::format("{}: '{}' is no parameter or state component of {}, and no option; the nearest "
                    "is {}, known "
                    "are {}",
                    where, shortened(name), system.name, *nearest, joined(known, ", ")));
}

void refuse_twins(const std::vector<Column>& columns, const Column& column, std::string_view where)
{
    for (const Column& other : columns) {
        if (other.is_option != column.is_option || other.parameter != column.parameter ||
            other.index != column.index || other.target != column.target) {
            continue;
        }
        const std::string both = other.name == column.name
                                     ? other.name
                                     : fmt::format("{}, which is {}", column.name, other.name);
        throw BadInput(fmt::format("{}: there is a column of {} already", where, both));
    }
}

void check_range(const SystemEntry& system, const Column& column, double value,
                 std::string_view where)
{
    if (!column.parameter || column.is_option) return;
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
    TableReader(const ColumnSource& source, std::string file)
        : source_(source), file_(std::move(file))
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
            Column column = source_.column(here, name);
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
            numbers_.push_back(value);
        }
    }

    const ColumnSource& source_;
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
    for (std::size_t k = 0; k < option_columns.size(); ++k) {
        if (option_columns[k].name != name) continue;
        return {.name = std::string(name),
                .unit = std::string(option_columns[k].unit),
                .parameter = false,
                .index = k,
                .is_option = true};
    }
    refuse_name(system, where, name);
}

Table read_table(const ColumnSource& source, const std::filesystem::path& file)
{
    const std::string content = ricochet::detail::read_file(file, [&](const std::string& why) {
        throw BadInput(
            fmt::format("the table '{}' cannot be read: {}", shortened(file.string()), why));
    });
    std::string_view rest = content;
    if (rest.starts_with("\xef\xbb\xbf")) rest.remove_prefix(3);  // a byte order mark
    TableReader reader(source, file.string());
    for (std::size_t line = 1; !rest.empty(); ++line) {
        const std::size_t end = rest.find('\n');
        reader.take(line, rest.substr(0, end));
        rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    }
    return reader.table();
}

namespace {

/// A rule for the numbers of one column.
struct Rule {
    enum class Kind { uniform, log_uniform, normal, grid, log_grid };
    Kind kind = Kind::uniform;
    double first = 0, second = 0;
    std::size_t count = 1;   ///< of a grid
    std::size_t stride = 1;  ///< rows until its value changes

    [[nodiscard]] double at(std::size_t row, std::uint64_t seed) const
    {
        ricochet::detail::SplitMix random(seed);
        switch (kind) {
            case Kind::uniform: return random.uniform(first, second);
            case Kind::log_uniform:
                return std::clamp(std::exp(random.uniform(std::log(first), std::log(second))),
                                  first, second);
            case Kind::normal: {
                // Of (0, 1], since its logarithm is taken.
                const double size = std::sqrt(-2 * std::log(1 - random.uniform(0, 1)));
                return first +
                       second * size * std::cos(2 * std::numbers::pi * random.uniform(0, 1));
            }
            case Kind::grid:
            case Kind::log_grid: break;
        }
        const std::size_t k = row / stride % count;
        if (k == 0) return first;
        if (k + 1 == count) return second;
        const double part = static_cast<double>(k) / static_cast<double>(count - 1);
        if (kind == Kind::grid) return first + part * (second - first);
        return first * std::pow(second / first, part);
    }
};

/// The parts of "name=a:b:c".
std::pair<std::string, std::vector<std::string>> parts_of(std::string_view text)
{
    const std::size_t equals = text.find('=');
    if (equals == text.npos || equals == 0) return {};
    std::vector<std::string> parts;
    for (std::string_view rest = text.substr(equals + 1);;) {
        const std::size_t colon = rest.find(':');
        parts.emplace_back(rest.substr(0, colon));
        if (colon == rest.npos) break;
        rest.remove_prefix(colon + 1);
    }
    return {std::string(text.substr(0, equals)), std::move(parts)};
}

void require_order(const Rule& rule, std::string_view where)
{
    if (!(rule.first <= rule.second)) {
        throw BadInput(fmt::format("{}: the lowest value is above the highest", where));
    }
    const bool log = rule.kind == Rule::Kind::log_uniform || rule.kind == Rule::Kind::log_grid;
    if (log && !(rule.first > 0)) {
        throw BadInput(fmt::format("{}: values by their logarithms must be positive, got {}", where,
                                   rule.first));
    }
}

Rule random_rule(const std::vector<std::string>& parts, std::string_view text,
                 std::string_view where)
{
    const std::string kind = parts.size() == 3 ? parts[2] : "uniform";
    const bool known = kind == "uniform" || kind == "log" || kind == "normal";
    if (parts.size() < 2 || parts.size() > 3 || !known) {
        throw BadInput(
            fmt::format("--vary must be name=lowest:highest, name=lowest:highest:log or "
                        "name=mean:deviation:normal, got '{}'",
                        shortened(text)));
    }
    Rule rule;
    rule.first = number(where, parts[0]);
    rule.second = number(where, parts[1]);
    if (kind == "normal") {
        rule.kind = Rule::Kind::normal;
        if (!(rule.second >= 0)) {
            throw BadInput(
                fmt::format("{}: the deviation must not be negative, got {}", where, rule.second));
        }
        return rule;
    }
    if (kind == "log") rule.kind = Rule::Kind::log_uniform;
    require_order(rule, where);
    return rule;
}

Rule grid_rule(const std::vector<std::string>& parts, std::string_view text, std::string_view where)
{
    const bool log = parts.size() == 4 && parts[3] == "log";
    if (parts.size() < 3 || parts.size() > 4 || (parts.size() == 4 && !log)) {
        throw BadInput(
            fmt::format("--grid must be name=first:last:count or "
                        "name=first:last:count:log, got '{}'",
                        shortened(text)));
    }
    Rule rule{.kind = log ? Rule::Kind::log_grid : Rule::Kind::grid};
    rule.first = number(where, parts[0]);
    rule.second = number(where, parts[1]);
    rule.count = whole_number(where, parts[2], 1, 1'000'000'000);
    require_order(rule, where);
    return rule;
}

}  // namespace

Table made_table(const ColumnSource& source, const std::vector<std::string>& grid,
                 const std::vector<std::string>& vary, std::size_t repeats, std::uint64_t seed)
{
    Table out{
        .columns = {}, .rows = repeats, .value = {}, .identity = fmt::format("seed {}", seed)};
    std::vector<Rule> rules;
    std::size_t points = 1;
    const auto add = [&](const std::string& text, std::string_view option, const auto& rule_of) {
        const std::string where = fmt::format("{} {}", option, shortened(text));
        const auto [name, parts] = parts_of(text);
        Rule rule = rule_of(parts, text, where);
        Column column = source.column(where, name);
        refuse_twins(out.columns, column, where);
        if (rule.kind != Rule::Kind::normal) {
            source.check(column, rule.first, where);
            source.check(column, rule.second, where);
        }
        rule.stride = points;
        points *= rule.count;
        if (points > 1'000'000'000) {
            throw BadInput(fmt::format("{}: the grid has more than 1e9 points", where));
        }
        rules.push_back(rule);
        const bool plain = rule.kind == Rule::Kind::uniform;
        out.identity += plain ? fmt::format(", {}={}:{}", name, rule.first, rule.second)
                              : fmt::format(", {}", text);
        out.columns.push_back(std::move(column));
    };
    for (const std::string& text : grid) add(text, "--grid", grid_rule);
    for (const std::string& text : vary) add(text, "--vary", random_rule);
    out.rows = repeats * points;
    out.value = [rules, seed](std::size_t row, std::size_t column) {
        return rules[column].at(row, row_seed(row_seed(seed, row), column));
    };
    return out;
}

ColumnSource columns_of(const SystemEntry& system)
{
    return {[&system](std::string_view where, std::string_view name) {
                return column_named(system, where, name);
            },
            [&system](const Column& column, double value, std::string_view where) {
                check_range(system, column, value, where);
            }};
}

}  // namespace ricochet::app
