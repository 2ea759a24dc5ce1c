// Labelled states on which a classifier of steps is trained.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace ricochet::learn {

/// Description of one feature.
struct Column {
    std::string name;
    std::string unit;  ///< "1" if it has none
};

/// n states of d features, each with the answer to "does the next step meet the
/// event surface?".
///
/// The margin of a state tells how far it is from the exact boundary between
/// the two answers, relative to the terms that cancel there: not positive for an
/// event, positive for a clear state, in [-1, 1].
struct DataSet {
    std::vector<Column> columns{};       ///< d
    std::vector<double> features{};      ///< n x d, row by row, before offset and scale
    std::vector<std::uint8_t> labels{};  ///< n; 1 an event, 0 clear
    std::vector<double> margins{};       ///< n

    [[nodiscard]] std::size_t size() const noexcept { return labels.size(); }
    [[nodiscard]] std::size_t width() const noexcept { return columns.size(); }

    /// The features of state i.
    [[nodiscard]] std::span<const double> row(std::size_t i) const noexcept
    {
        return {features.data() + i * width(), width()};
    }

    /// Number of states that are events.
    [[nodiscard]] std::size_t events() const noexcept;

    /// @param row  d features
    void append(std::span<const double> row, bool event, double margin);
};

/// The states with these indices, in this order.
[[nodiscard]] DataSet select(const DataSet& data, std::span<const std::size_t> rows);

/// All states of both data sets.
/// @throws std::invalid_argument if they differ in the number of columns.
[[nodiscard]] DataSet join(const DataSet& a, const DataSet& b);

/// Two disjoint parts that together hold every state once.
struct Split {
    DataSet kept;
    DataSet held_out;
};

/// Holds out the fraction `share` of the events and the same fraction of the clear states, each
/// rounded to a whole number, drawn at random from `seed`. The order within each part is
/// that of `data`.
/// @throws std::invalid_argument unless 0 <= share <= 1.
[[nodiscard]] Split split(const DataSet& data, double share, std::uint64_t seed);

/// Checks that the parts of `data` fit together and every number is finite.
/// @throws std::invalid_argument naming what does not fit.
void check(const DataSet& data);

}  // namespace ricochet::learn
