// The module `_fmi`: FMUs and their runs; what users call is in python/ricochet/_fmu.py.
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "ricochet/fmi/run.hpp"

namespace py = pybind11;

namespace {

using namespace ricochet::fmi;
using Function = std::function<double(double)>;

py::dict describe_variable(const Variable& v)
{
    py::dict out;
    out["causality"] = std::string(name(v.causality));
    out["variability"] = std::string(name(v.variability));
    out["unit"] = v.unit;
    out["description"] = v.description;
    out["start"] = v.start;
    out["dimensions"] = v.dimensions;
    out["number"] = is_number(v.type);
    return out;
}

py::dict describe(const Fmu& fmu)
{
    const Description& d = fmu.description();
    py::dict variables, out;
    for (const Variable& v : d.variables) variables[py::str(v.name)] = describe_variable(v);
    out["variables"] = variables;
    out["name"] = d.model_name;
    out["version"] = d.version_text;
    out["states"] = d.state_names();
    out["indicators"] = d.indicator_count;
    out["model_exchange"] = d.model_exchange.has_value();
    out["co_simulation"] = d.co_simulation.has_value();
    out["once_per_process"] = (d.model_exchange && d.model_exchange->once_per_process) ||
                              (d.co_simulation && d.co_simulation->once_per_process);
    out["t_start"] = d.t_start;
    out["t_end"] = d.t_end;
    return out;
}

Method method_of(const std::string& wanted)
{
    for (const Method method :
         {Method::automatic, Method::dopri5, Method::fehlberg78, Method::rosenbrock4}) {
        if (wanted == name(method)) return method;
    }
    throw std::invalid_argument("load_fmu: found the method '" + wanted +
                                "'; expected automatic, dopri5, fehlberg78 or rosenbrock4");
}

py::list causes_of(const Causes& causes)
{
    py::list out;
    if (causes.state) out.append("state");
    if (causes.time) out.append("time");
    if (causes.step) out.append("step");
    if (causes.input) out.append("input");
    if (causes.passage) out.append("passage");
    return out;
}

py::dict as_dict(const Description& d, const Run& run)
{
    py::list events;
    for (const Event& event : run.events) {
        events.append(py::make_tuple(
            event.t, causes_of(event.causes),
            event.watch != no_indicator ? py::object(py::int_(event.watch)) : py::none(),
            event.indicator == no_indicator ? "" : d.indicator_name(event.indicator),
            py::array_t<double>(static_cast<py::ssize_t>(event.before.size()), event.before.data()),
            py::array_t<double>(static_cast<py::ssize_t>(event.after.size()), event.after.data())));
    }
    const auto rows = static_cast<py::ssize_t>(run.rows.size());
    const auto columns = static_cast<py::ssize_t>(run.output.size());
    py::array_t<double> t(rows), values({rows, columns});
    py::array_t<std::int8_t> sides(rows);
    auto at = t.mutable_unchecked<1>();
    auto value = values.mutable_unchecked<2>();
    auto side = sides.mutable_unchecked<1>();
    for (py::ssize_t i = 0; i < rows; ++i) {
        const Row& row = run.rows[static_cast<std::size_t>(i)];
        at(i) = row.t;
        side(i) = row.place == Row::Place::sample         ? 0
                  : row.place == Row::Place::before_event ? -1
                                                          : 1;
        for (py::ssize_t k = 0; k < columns; ++k) {
            value(i, k) = row.values[static_cast<std::size_t>(k)];
        }
    }
    const Calls& c = run.calls;
    py::dict out;
    out["outcome"] = std::string(name(run.end));
    out["message"] = describe(run);
    out["t_end"] = run.t;
    out["x"] = run.x;
    out["events"] = events;
    out["output"] = run.output;
    out["t"] = t;
    out["values"] = values;
    out["sides"] = sides;
    out["warnings"] = run.warnings;
    out["method"] = std::string(name(run.method));
    out["statistics"] =
        py::dict(py::arg("steps") = run.steps, py::arg("rejected") = run.rejected,
                 py::arg("derivatives") = c.derivatives, py::arg("indicators") = c.indicators,
                 py::arg("event_modes") = c.event_modes, py::arg("set_time") = c.set_time);
    return out;
}

/// A run that Ctrl-C can end between two events.
py::dict run_fmu(const Fmu& fmu, const py::dict& given)
{
    Options options;
    options.t_start = given["t_start"].cast<std::optional<double>>();
    options.t_end = given["t_end"].cast<std::optional<double>>();
    options.rtol = given["rtol"].cast<double>();
    options.method = method_of(given["method"].cast<std::string>());
    options.h_max = given["h_max"].cast<double>();
    options.start = given["start"].cast<std::vector<std::pair<std::string, double>>>();
    options.output = given["output"].cast<std::vector<std::string>>();
    options.sample_times = given["sample_times"].cast<std::vector<double>>();
    options.step = given["step"].cast<std::optional<double>>();
    options.co_simulation = given["co_simulation"].cast<std::optional<bool>>();
    for (auto& [name, level, crossing] :
         given["watch"].cast<std::vector<std::tuple<std::string, double, int>>>()) {
        options.watch.push_back({.name = name,
                                 .level = level,
                                 .crossing = crossing < 0   ? ricochet::Crossing::falling
                                             : crossing > 0 ? ricochet::Crossing::rising
                                                            : ricochet::Crossing::either});
    }
    for (const auto& item : given["tables"].cast<py::list>()) {
        auto [name, t, values] =
            item.cast<std::tuple<std::string, std::vector<double>, std::vector<double>>>();
        options.inputs.push_back({.name = name, .t = std::move(t), .values = std::move(values)});
    }
    for (const auto& item : given["functions"].cast<py::list>()) {
        auto [name, function] = item.cast<std::pair<std::string, Function>>();
        options.inputs.push_back(
            {.name = name, .t = {}, .values = {}, .function = std::move(function)});
    }
    Simulation simulation(fmu, options);
    const auto advance = [&] {
        const py::gil_scoped_release release;
        return simulation.advance();
    };
    while (advance()) {
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
    return as_dict(fmu.description(), simulation.finish());
}

}  // namespace

PYBIND11_MODULE(_fmi, module)
{
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(thrown);
        } catch (const Error& error) {
            PyErr_SetString(PyExc_ValueError, error.what());
        }
    });
    py::class_<Fmu>(module, "Fmu")
        .def(py::init<std::filesystem::path>())
        .def("describe", [](const Fmu& fmu) { return ::describe(fmu); })
        .def("run", &run_fmu);
}
