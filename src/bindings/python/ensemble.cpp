// Ensembles of systems that need no interpreter: ready ones, and one's own of formulas and compiled
// functions.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "background.hpp"
#include "bindings.hpp"
#include "read_request.hpp"
#include "ready.hpp"
#include "results.hpp"
#include "ricochet/ensemble.hpp"
#include "ricochet/run.hpp"
#include "setup.hpp"

namespace ricochet::python {

namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// A table with a row for each run.
class Table {
public:
    explicit Table(const Numbers& numbers)
        : first_(numbers.data()),
          rows_(static_cast<std::size_t>(numbers.shape(0))),
          columns_(static_cast<std::size_t>(numbers.shape(1)))
    {
    }

    [[nodiscard]] std::size_t rows() const noexcept { return rows_; }
    [[nodiscard]] std::size_t columns() const noexcept { return columns_; }
    [[nodiscard]] std::span<const double> operator[](std::size_t row) const noexcept
    {
        return {first_ + row * columns_, columns_};
    }

private:
    const double* first_;
    std::size_t rows_, columns_;
};

/// A run by the general loop.
Record run_loop(const Request& request, const Source& source, const State& x0)
{
    const std::unique_ptr<RunAdapter> adapter = source.open_for(request, x0);
    const OwnedSetup owned = setup_for(request, source, *adapter);
    const RunLoop loop(request, owned, *adapter, x0);
    loop->run_to_end();
    return loop.record(loop->finish(), *adapter);
}

Record run_row(const Request& request, const Source& source, std::span<const double> start)
{
    const State x0(start.begin(), start.end());
    if (request.is_plain_or_series()) {
        SignalWatch watch;  // signals are handled by the caller's thread
        if (std::optional<Record> whole = source.run_whole(x0, request, watch)) {
            return std::move(*whole);
        }
    }
    return run_loop(request, source, x0);
}

/// Results as columns, and what was recorded along the way.
class Columns {
public:
    Columns(std::size_t rows, std::size_t components, std::size_t samples)
        : components_(components),
          samples_(samples),
          outcome_(rows),
          t_(rows, none),
          x_(rows * components, none),
          mode_(rows),
          counts_(5 * rows),
          events_(rows),
          states_(rows * samples * components, none)
    {
    }

    void put(std::size_t row, Record&& record)
    {
        outcome_[row] = name(record.outcome);
        t_[row] = record.t;
        const auto put_at = [&](std::vector<double>& out, std::size_t place,
                                const std::vector<double>& values) {
            std::ranges::copy(values,
                              out.begin() + static_cast<std::ptrdiff_t>(place * components_));
        };
        put_at(x_, row, record.x);
        put_at(states_, row * samples_, record.states);
        mode_[row] = record.mode;
        const Statistics& s = record.statistics;
        const std::uint64_t all[5] = {s.events, s.steps, s.rejected, s.flow_calls, s.guard_calls};
        std::copy_n(all, 5, counts_.begin() + static_cast<std::ptrdiff_t>(5 * row));
        events_[row] = {record.event_count, std::move(record.events)};
    }

    [[nodiscard]] py::dict handed_over(const detail::RowsRun& run) const
    {
        py::dict failed;
        std::vector<std::string_view> outcomes = outcome_;
        for (const RowFailure& failure : run.failures) {
            failed[py::int_(failure.row)] = failure.message;
            outcomes[failure.row] = "failed";
        }
        // Few different ones, which NumPy turns into texts faster than all of them.
        py::list names;
        std::vector<std::string_view> known;
        std::vector<std::uint8_t> numbers;
        for (const std::string_view outcome : outcomes) {
            const auto found = std::ranges::find(known, outcome);
            numbers.push_back(static_cast<std::uint8_t>(found - known.begin()));
            if (found != known.end()) continue;
            known.push_back(outcome);
            names.append(py::str(outcome));
        }
        // A run that was stopped in its last chunk has no outcome.
        const bool complete = run.complete && std::ranges::find(known, "") == known.end();
        using namespace py::literals;
        return py::dict("outcomes"_a = names, "outcome"_a = array_of(numbers), "t"_a = array_of(t_),
                        "x"_a = array_of(x_), "mode"_a = array_of(mode_),
                        "counts"_a = array_of(counts_), "failed"_a = failed,
                        "complete"_a = complete, "events"_a = joined_events(),
                        "event_counts"_a = event_counts(), "states"_a = array_of(states_));
    }

private:
    struct Events {
        std::size_t count = 0;
        std::vector<double> values;  ///< as in a `Record`
    };

    [[nodiscard]] py::array event_counts() const
    {
        std::vector<std::int64_t> counts;
        for (const Events& each : events_) counts.push_back(static_cast<std::int64_t>(each.count));
        return array_of(counts);
    }
    /// The events of all rows, one after the other.
    [[nodiscard]] py::array joined_events() const
    {
        std::size_t count = 0;
        for (const Events& each : events_) count += each.count;
        py::array out = new_events(components_, count);
        auto* to = static_cast<double*>(out.mutable_data());
        for (const Events& each : events_) to = std::ranges::copy(each.values, to).out;
        return out;
    }

    static constexpr double none = std::numeric_limits<double>::quiet_NaN();
    std::size_t components_, samples_;
    std::vector<std::string_view> outcome_;  ///< empty if the row was not run
    std::vector<double> t_, x_;
    std::vector<std::uint32_t> mode_;
    std::vector<std::uint64_t> counts_;
    std::vector<Events> events_;
    std::vector<double> states_;
};

Background<EnsembleProgress>::Show shower(const py::object& progress)
{
    if (progress.is_none()) return {};
    return [&progress](const EnsembleProgress& now) {
        return !progress(now.done, now.rows).is(py::bool_(false));
    };
}

/// Keeps what a run has given; one that was cancelled counts as not run.
void put(Columns& columns, std::size_t row, Record&& record)
{
    if (record.outcome != Outcome::cancelled) columns.put(row, std::move(record));
}

/// Runs the rows of `starts`, in a thread that signals and progress do not wait for.
/// @param work  (request, columns, options) -> RowsRun
template <class Work>
py::dict run_all(const Table& starts, Request&& request, unsigned threads,
                 const py::object& progress, const Work& work)
{
    validate(request.options, request.fixed);
    Columns columns(starts.rows(), starts.columns(), request.options.sample_times.size());
    Background<EnsembleProgress> background(shower(progress));
    request.options.cancelled = &background.stopped();
    detail::RowsRun rows;
    background.run([&] {
        rows =
            work(request, columns,
                 {.threads = threads,
                  .progress = [&](const EnsembleProgress& now) { return background.report(now); },
                  .cancelled = &background.stopped()});
    });
    if (background.raised()) {
        background.raised()->restore();
        throw py::error_already_set();
    }
    return columns.handed_over(rows);
}

/// The same row by row.
/// @param run  (request, row) -> Record, from several threads at a time
template <class Run>
py::dict run_each(const Table& starts, Request&& request, unsigned threads,
                  const py::object& progress, const Run& run)
{
    return run_all(
        starts, std::move(request), threads, progress,
        [&](const Request& all, Columns& columns, const EnsembleOptions& options) {
            return detail::run_rows(
                starts.rows(),
                [&](const EnsembleRow& row) { put(columns, row.index, run(all, row.index)); },
                options);
        });
}

/// Runs rows side by side, in blocks.
detail::RowsRun run_blocks(const Table& starts, const Source& source, const Request& request,
                           Columns& columns, const EnsembleOptions& options)
{
    // Some for each thread, each of them long compared with its last rows.
    const std::size_t threads =
        options.threads > 0 ? options.threads : std::max(std::thread::hardware_concurrency(), 1U);
    const std::size_t rows = starts.rows();
    const std::size_t block = std::clamp<std::size_t>(rows / (4 * threads), 32, 256);
    std::mutex mutex;
    std::vector<RowFailure> failures;
    EnsembleOptions of_blocks = options;
    of_blocks.progress = [&](const EnsembleProgress& now) {
        return options.progress({.first = now.first * block,
                                 .count = now.count * block,
                                 .done = std::min(now.done * block, rows),
                                 .rows = rows});
    };
    detail::RowsRun out = detail::run_rows(
        (rows + block - 1) / block,
        [&](const EnsembleRow& of) {
            const std::size_t first = of.index * block;
            source.run_side_by_side(
                request,
                {.first = first,
                 .count = std::min(block, rows - first),
                 .start =
                     [&](std::size_t row) { return State(starts[row].begin(), starts[row].end()); },
                 .keep = [&](std::size_t row,
                             Record&& record) { put(columns, row, std::move(record)); },
                 .fail =
                     [&](std::size_t row, const std::exception_ptr& thrown) {
                         const std::scoped_lock lock(mutex);
                         failures.push_back({.row = row, .exception = thrown, .message = {}});
                     }});
        },
        of_blocks);
    out.failures.insert(out.failures.end(), failures.begin(), failures.end());
    return out;
}

/// @param names  of the parameters, as in models
py::dict ready_ensemble(const std::string& system, const std::vector<std::string>& names,
                        const Numbers& parameters, const Numbers& starts, const py::dict& options,
                        unsigned threads, const py::object& progress)
{
    const Table table(starts), values(parameters);
    Request request = request_from(options);
    request.options.record_events = false;
    const bool mode_given = options.contains("mode");
    return run_each(table, std::move(request), threads, progress,
                    [&](const Request& all, std::size_t row) {
                        const std::shared_ptr<Source> source = ready_system(system, values[row]);
                        for (std::size_t i = 0; i < names.size(); ++i) {
                            source->parameters.emplace(names[i], values[row][i]);
                        }
                        Request own = all;
                        if (!mode_given) own.options.mode = source->start_mode();
                        return run_row(own, *source, table[row]);
                    });
}

/// @param parameters  of formulas, row by row
py::dict own_ensemble(const std::shared_ptr<Source>& source, const Numbers& parameters,
                      const Numbers& starts, const py::dict& options, unsigned threads,
                      const py::object& progress)
{
    const Table table(starts), values(parameters);
    if (values.columns() < source->parameter_count() || values.rows() != table.rows()) {
        throw py::value_error("parameters: found a table of another shape, expected " +
                              std::to_string(source->parameter_count()) + " columns");
    }
    Request request = request_from(options);
    if (source->runs_side_by_side(request, table.columns())) {
        py::dict out =
            run_all(table, std::move(request), threads, progress,
                    [&](const Request& all, Columns& columns, const EnsembleOptions& of) {
                        return run_blocks(table, *source, all, columns, of);
                    });
        out["side_by_side"] = true;
        return out;
    }
    return run_each(table, std::move(request), threads, progress,
                    [&](const Request& all, std::size_t row) {
                        if (source->parameter_count() == 0)
                            return run_row(all, *source, table[row]);
                        Request own = all;
                        own.parameters = values[row].data();
                        return run_row(own, *source, table[row]);
                    });
}

}  // namespace

void bind_ensemble(py::module_& module)
{
    module.def("ready_ensemble", &ready_ensemble);
    module.def("own_ensemble", &own_ensemble);
    module.def("row_seed",
               [](std::uint64_t seed, std::size_t index) { return row_seed(seed, index); });
}

}  // namespace ricochet::python
