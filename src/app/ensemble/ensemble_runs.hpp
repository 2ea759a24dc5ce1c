// The runs of an ensemble: from rows of a table to rows of results.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "../json_text.hpp"
#include "../registry.hpp"
#include "rows.hpp"
#include "table.hpp"

namespace ricochet::app {

/// What runs the rows of a table.
class RowRuns {
public:
    RowRuns() = default;
    virtual ~RowRuns() = default;
    RowRuns(const RowRuns&) = delete;
    RowRuns& operator=(const RowRuns&) = delete;

    /// Of the system or the scene.
    [[nodiscard]] virtual std::string name() const = 0;
    [[nodiscard]] virtual const Table& table() const = 0;
    /// Everything on which the results depend, the fields that they have, and the number of shares.
    [[nodiscard]] virtual Json setup(std::size_t shares) const = 0;
    /// Runs a row and appends its fields. An exception becomes the outcome "failed", with its
    /// message. Several threads may call it.
    virtual void run_row(std::size_t row, std::string& out) const = 0;
};

/// Characters of the names of outcomes; the longest is time_event_not_ahead.
inline constexpr std::size_t outcome_width = 24;
inline constexpr std::string_view failed_row = "failed";

/// Names and units of columns or components.
template <class Parts>
[[nodiscard]] Json names_and_units(const Parts& parts)
{
    Json out = Json::array();
    for (const auto& part : parts) out.push_back({part.name, part.unit});
    return out;
}

/// Fields for the times [s] of the first events.
void add_event_fields(std::size_t events, std::vector<Field>& fields);

/// One system under settings that the rows of a table vary.
class EnsembleRuns final : public RowRuns {
public:
    /// @param events  number of the first events whose times are results
    /// @throws BadInput where the request does not fit the system or the table.
    EnsembleRuns(const SystemEntry& system, const RunRequest& request, Table table,
                 std::size_t events);

    [[nodiscard]] std::string name() const override { return std::string(system_.name); }
    [[nodiscard]] const Table& table() const override { return table_; }
    [[nodiscard]] Json setup(std::size_t shares) const override;
    void run_row(std::size_t row, std::string& out) const override;

private:
    void put_failure(std::size_t row, std::string_view message, std::string& out) const;
    void put_inputs(std::size_t row, RowWriter& out) const;
    static void set_option(const Column& column, double value, Options& options);

    const SystemEntry& system_;
    RunSettings settings_;
    bool mode_follows_ = false;  ///< from the parameters
    bool sets_options_ = false;  ///< whether a column does
    Table table_;
    std::size_t events_ = 0;
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
