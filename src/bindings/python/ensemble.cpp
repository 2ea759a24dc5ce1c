// Ensembles of ready systems.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "background.hpp"
#include "bindings.hpp"
#include "read_request.hpp"
#include "ready.hpp"
#include "ricochet/ensemble.hpp"
#include "ricochet/run.hpp"
#include "setup.hpp"

namespace ricochet::python {

namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Data that all rows share.
struct Ensembled {
    std::string system;
    std::vector<std::string> names;  ///< names of the parameters, as in models
    Request request;
    bool mode_given = false;
    std::size_t parameters = 0;
    std::size_t components = 0;
    const double* parameter_table = nullptr;  ///< row by row
    const double* start_table = nullptr;      ///< row by row
};

/// A run by the general loop.
Record run_loop(const Request& request, const Source& source, const State& x0)
{
    const std::unique_ptr<RunAdapter> adapter = open_for(request, source, x0);
    const OwnedSetup owned = setup_for(request, source, *adapter);
    const auto loop = detail::make_loop(owned.setup, x0, request.options);
    while (!loop->ended()) loop->advance_once(true);
    return record_of(loop->finish());
}

Record run_row(const Ensembled& all, std::size_t row)
{
    const std::span<const double> parameters(all.parameter_table + row * all.parameters,
                                             all.parameters);
    const double* from = all.start_table + row * all.components;
    const State x0(from, from + all.components);
    const std::shared_ptr<Source> source = ready_system(all.system, parameters);
    for (std::size_t i = 0; i < all.names.size(); ++i) {
        source->parameters.emplace(all.names[i], parameters[i]);
    }
    Request request = all.request;
    if (!all.mode_given) request.options.mode = source->start_mode();
    if (request.is_plain()) {
        SignalWatch watch;  // signals are handled by the caller's thread
        if (std::optional<Record> whole = source->run_whole(x0, request, watch)) {
            return std::move(*whole);
        }
    }
    return run_loop(request, *source, x0);
}

/// Results as columns.
struct Columns {
    Columns(std::size_t rows, std::size_t components)
        : outcome(rows), t(rows, none), x(rows * components, none), mode(rows), counts(5 * rows)
    {
    }

    void put(std::size_t row, const Record& record, std::size_t components)
    {
        outcome[row] = name(record.outcome);
        t[row] = record.t;
        std::copy_n(record.x.begin(), std::min(components, record.x.size()),
                    x.begin() + static_cast<std::ptrdiff_t>(row * components));
        mode[row] = record.mode;
        const Statistics& s = record.statistics;
        const std::uint64_t all[5] = {s.events, s.steps, s.rejected, s.flow_calls, s.guard_calls};
        std::copy_n(all, 5, counts.begin() + static_cast<std::ptrdiff_t>(5 * row));
    }

    static constexpr double none = std::numeric_limits<double>::quiet_NaN();
    std::vector<std::string_view> outcome;  ///< empty if the row was not run
    std::vector<double> t, x;
    std::vector<std::uint32_t> mode;
    std::vector<std::uint64_t> counts;
};

Background<EnsembleProgress>::Show shower(const py::object& progress)
{
    if (progress.is_none()) return {};
    return [&progress](const EnsembleProgress& now) {
        return !progress(now.done, now.rows).is(py::bool_(false));
    };
}

py::dict handed_over(const Columns& columns, const detail::RowsRun& run)
{
    py::dict failures;
    std::vector<std::string_view> outcomes = columns.outcome;
    for (const RowFailure& failure : run.failures) {
        failures[py::int_(failure.row)] = failure.message;
        outcomes[failure.row] = "failed";
    }
    py::list names;
    for (const std::string_view outcome : outcomes) names.append(py::str(outcome));
    using namespace py::literals;
    return py::dict("outcome"_a = names, "t"_a = array_of(columns.t), "x"_a = array_of(columns.x),
                    "mode"_a = array_of(columns.mode), "counts"_a = array_of(columns.counts),
                    "failures"_a = failures, "complete"_a = run.complete);
}

py::dict ensemble(const std::string& system, const std::vector<std::string>& names,
                  const Numbers& parameters, const Numbers& starts, const py::dict& options,
                  unsigned threads, const py::object& progress)
{
    Ensembled all{.system = system,
                  .names = names,
                  .request = request_from(options),
                  .mode_given = options.contains("mode"),
                  .parameters = static_cast<std::size_t>(parameters.shape(1)),
                  .components = static_cast<std::size_t>(starts.shape(1)),
                  .parameter_table = parameters.data(),
                  .start_table = starts.data()};
    const auto rows = static_cast<std::size_t>(starts.shape(0));
    all.request.options.record_events = false;
    validate(all.request.options, all.request.fixed);
    Columns columns(rows, all.components);
    Background<EnsembleProgress> background(shower(progress));
    all.request.options.cancelled = &background.stopped();
    detail::RowsRun run;
    background.run([&] {
        run = detail::run_rows(
            rows,
            [&](const EnsembleRow& row) {
                const Record record = run_row(all, row.index);
                if (record.outcome == Outcome::cancelled) return;  // counts as not run
                columns.put(row.index, record, all.components);
            },
            {.threads = threads,
             .progress = [&](const EnsembleProgress& now) { return background.report(now); },
             .cancelled = &background.stopped()});
    });
    if (background.raised()) {
        background.raised()->restore();
        throw py::error_already_set();
    }
    return handed_over(columns, run);
}

}  // namespace

void bind_ensemble(py::module_& module)
{
    module.def("ensemble", &ensemble);
    module.def("row_seed",
               [](std::uint64_t seed, std::size_t index) { return row_seed(seed, index); });
}

}  // namespace ricochet::python
