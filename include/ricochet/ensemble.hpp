// Ensembles: many runs that differ in parameters or starts, on all cores.
//
//     struct Drop { double height, restitution; };
//     const std::vector<Drop> table = ...;
//     const auto balls = ensemble(table, [](const Drop& row) {
//         const BouncingBall ball({.restitution = row.restitution});
//         return integrate(ball, {row.height, 0}, {.t_end = 20.5}).x;
//     });
//
// A table has `size()` and `[i]`, such as a vector of structures or of states, or is a number of
// rows. The result of a row is a function of the row and of its seed alone, so that the results
// have the same bits for any number of threads; the function is called from several threads at a
// time.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace ricochet {

/// Place of a run in an ensemble.
struct EnsembleRow {
    std::size_t index = 0;   ///< row of the table, from 0
    std::uint64_t seed = 0;  ///< the `row_seed` of this row
};

/// Seed of the random numbers of row `index`, from the ensemble's seed. Different rows of one
/// ensemble have different seeds.
[[nodiscard]] std::uint64_t row_seed(std::uint64_t seed, std::size_t index) noexcept;

/// Rows of a chunk, after which progress is reported. Threads take no more than these together.
inline constexpr std::size_t ensemble_chunk = 64;

/// Progress of an ensemble, after a chunk of rows.
struct EnsembleProgress {
    std::size_t first = 0;  ///< first row of the chunk that has just ended
    std::size_t count = 0;  ///< number of its rows
    std::size_t done = 0;   ///< rows in all chunks that have ended
    std::size_t rows = 0;   ///< number of rows of the table
};

/// Options of `ensemble`.
struct EnsembleOptions {
    unsigned threads = 0;    ///< at most 1024; 0: one for each core that the process may use
    std::uint64_t seed = 0;  ///< seed of the ensemble, from which those of all rows follow

    /// Called after every chunk, by one thread at a time. If it returns false, no further chunk is
    /// started. Exceptions that it throws are thrown by `ensemble`.
    std::function<bool(const EnsembleProgress&)> progress{};

    /// Set from another thread or a signal handler: no further row is started. Runs in progress end
    /// early if their `Options::cancelled` is the same flag.
    const std::atomic<bool>* cancelled = nullptr;
};

/// A row whose function threw an exception.
struct RowFailure {
    std::size_t row = 0;
    std::exception_ptr exception;
    std::string message;  ///< its `what()`, if it is a std::exception
};

/// Results of an ensemble, row by row.
template <class Result>
struct Ensemble {
    std::vector<std::optional<Result>> rows{};  ///< empty where a row failed or was not run
    std::vector<RowFailure> failures{};         ///< in the order of their rows
    bool complete = false;                      ///< every row was run, or failed
};

namespace detail {

struct RowsRun {
    std::vector<RowFailure> failures;
    bool complete = false;
};

/// Calls `run` for the rows 0 ... rows - 1 in chunks.
/// @throws std::invalid_argument for options out of range.
[[nodiscard]] RowsRun run_rows(std::size_t rows, const std::function<void(const EnsembleRow&)>& run,
                               const EnsembleOptions& options);

}  // namespace detail

/// Tables with rows `table[i]`, i < `table.size()`.
template <class Table>
concept RowTable = requires(const Table& table)
{
    table.size();
    table[0];
};

/// Calls `run(table[i], EnsembleRow)`, or `run(table[i])`, for every row i of `table`.
///
/// An exception that a row throws is kept in `failures`; the other rows are still run.
/// @throws std::invalid_argument for options out of range.
template <RowTable Table, class Run>
[[nodiscard]] auto ensemble(const Table& table, const Run& run, const EnsembleOptions& options = {})
{
    const auto at = [&](const EnsembleRow& row) {
        if constexpr (std::is_invocable_v<const Run&, decltype(table[0]), const EnsembleRow&>) {
            return run(table[row.index], row);
        } else {
            return run(table[row.index]);
        }
    };
    using Result = decltype(at(EnsembleRow{}));
    static_assert(!std::is_void_v<Result>, "ensemble: the function of a row returns its result");
    Ensemble<Result> out;
    const auto rows = static_cast<std::size_t>(table.size());
    out.rows.resize(rows);
    detail::RowsRun all = detail::run_rows(
        rows, [&](const EnsembleRow& row) { out.rows[row.index].emplace(at(row)); }, options);
    out.failures = std::move(all.failures);
    out.complete = all.complete;
    return out;
}

/// The same without a table: calls `run(EnsembleRow)` for the given number of rows.
template <class Run>
requires std::is_invocable_v<const Run&, const EnsembleRow&>
[[nodiscard]] auto ensemble(std::size_t rows, const Run& run, const EnsembleOptions& options = {})
{
    struct Numbers {
        std::size_t count;
        [[nodiscard]] std::size_t size() const { return count; }
        std::size_t operator[](std::size_t i) const { return i; }
    };
    const auto numbered = [&](std::size_t, const EnsembleRow& row) { return run(row); };
    return ensemble(Numbers{rows}, numbered, options);
}

}  // namespace ricochet
