// The runs of an ensemble: from rows of a table to rows of results.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "../json_text.hpp"
#include "../registry.hpp"
#include "rows.hpp"
#include "table.hpp"

namespace ricochet::app {

/// One system under settings that the rows of a table vary.
class EnsembleRuns {
public:
    /// @throws BadInput where the request does not fit the system or the table.
    EnsembleRuns(const SystemEntry& system, const RunRequest& request, Table table);

    [[nodiscard]] const SystemEntry& system() const noexcept { return system_; }
    [[nodiscard]] const Table& table() const noexcept { return table_; }
    /// Everything on which the results depend, the fields that they have, and the number of shares.
    [[nodiscard]] Json setup(std::size_t shares) const;

    /// Runs a row and appends its fields. An exception becomes the outcome "failed", with its
    /// message. Several threads may call it.
    void run_row(std::size_t row, std::string& out) const;

private:
    void put_failure(std::size_t row, std::string_view message, std::string& out) const;
    void put_inputs(std::size_t row, RowWriter& out) const;

    const SystemEntry& system_;
    RunSettings settings_;
    bool mode_follows_ = false;  ///< from the parameters
    Table table_;
};

/// Outcomes of rows, and the number of their events.
struct EnsembleTally {
    std::map<std::string, std::size_t> outcomes{};
    std::uint64_t events = 0;
    std::string first_failure{};  ///< "row 17: ...", of the lowest row

    /// @param rows  bytes of rows with these fields
    void add(const std::vector<Field>& fields, std::string_view rows);

private:
    std::uint64_t failed_row_ = 0;
};

}  // namespace ricochet::app
