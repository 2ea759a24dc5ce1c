#include "ricochet/learn/data_set.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/require.hpp"
#include "ricochet/base/random.hpp"

namespace ricochet::learn {

std::size_t DataSet::events() const noexcept
{
    return static_cast<std::size_t>(std::count(labels.begin(), labels.end(), std::uint8_t{1}));
}

void DataSet::append(std::span<const double> row, bool event, double margin)
{
    features.insert(features.end(), row.begin(), row.end());
    labels.push_back(event ? 1 : 0);
    margins.push_back(margin);
}

DataSet select(const DataSet& data, std::span<const std::size_t> rows)
{
    DataSet chosen{.columns = data.columns};
    chosen.features.reserve(rows.size() * data.width());
    chosen.labels.reserve(rows.size());
    chosen.margins.reserve(rows.size());
    for (const std::size_t i : rows) {
        chosen.append(data.row(i), data.labels[i] != 0, data.margins[i]);
    }
    return chosen;
}

DataSet join(const DataSet& a, const DataSet& b)
{
    if (a.width() != b.width()) {
        throw std::invalid_argument("join: data sets of " + std::to_string(a.width()) + " and " +
                                    std::to_string(b.width()) + " columns");
    }
    DataSet both = a;
    both.features.insert(both.features.end(), b.features.begin(), b.features.end());
    both.labels.insert(both.labels.end(), b.labels.begin(), b.labels.end());
    both.margins.insert(both.margins.end(), b.margins.begin(), b.margins.end());
    return both;
}

Split split(const DataSet& data, double share, std::uint64_t seed)
{
    if (!(share >= 0 && share <= 1)) {
        throw std::invalid_argument("split: the share held out must lie in [0, 1], got " +
                                    std::to_string(share));
    }
    const auto quota = [share](std::size_t n) {
        return static_cast<std::size_t>(std::lround(share * static_cast<double>(n)));
    };
    std::size_t events_left = quota(data.events());
    std::size_t clear_left = quota(data.size() - data.events());

    Random random(seed);
    std::vector<bool> held_out(data.size(), false);
    for (const std::size_t i : permutation(data.size(), random)) {
        std::size_t& left = data.labels[i] != 0 ? events_left : clear_left;
        if (left == 0) continue;
        held_out[i] = true;
        --left;
    }
    std::vector<std::size_t> kept_rows;
    std::vector<std::size_t> held_out_rows;
    for (std::size_t i = 0; i < data.size(); ++i) {
        (held_out[i] ? held_out_rows : kept_rows).push_back(i);
    }
    return {.kept = select(data, kept_rows), .held_out = select(data, held_out_rows)};
}

void check(const DataSet& data)
{
    const std::size_t n = data.size();
    constexpr ricochet::detail::Refuse refuse{"data set"};
    if (data.width() == 0) refuse("no columns");
    if (data.features.size() != n * data.width()) {
        refuse("expected " + std::to_string(n) + " x " + std::to_string(data.width()) +
               " features, found " + std::to_string(data.features.size()) + " numbers");
    }
    if (data.margins.size() != n) {
        refuse("expected " + std::to_string(n) + " margins, found " +
               std::to_string(data.margins.size()));
    }
    for (std::size_t i = 0; i < data.features.size(); ++i) {
        if (!std::isfinite(data.features[i])) {
            refuse("state " + std::to_string(i / data.width()) + ", column '" +
                   data.columns[i % data.width()].name + "' is not finite");
        }
    }
    for (std::size_t i = 0; i < n; ++i) {
        if (data.labels[i] > 1) {
            refuse("state " + std::to_string(i) + " has the label " +
                   std::to_string(data.labels[i]) + ", expected 0 or 1");
        }
    }
}

}  // namespace ricochet::learn
