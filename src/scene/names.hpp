// Guess of the intended name.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ricochet::detail {

/// Number of insertions, deletions and replacements that turn `a` into `b`.
[[nodiscard]] inline std::size_t edits(std::string_view a, std::string_view b)
{
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = std::exchange(row[0], i);
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row[b.size()];
}

/// ", the nearest known name is 'x'", or nothing where no name is known.
template <class Names>
[[nodiscard]] std::string nearest_name(std::string_view given, const Names& known)
{
    std::string best;
    std::size_t least = std::string::npos;
    for (const auto& name : known) {
        const std::size_t distance = edits(given.substr(0, 64), std::string_view(name));
        if (distance < least || (distance == least && std::string_view(name) < best)) {
            least = distance;
            best = name;
        }
    }
    return best.empty() ? "" : fmt::format(", the nearest known is \"{}\"", best);
}

}  // namespace ricochet::detail
