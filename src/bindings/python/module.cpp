// The module `_ricochet`; what users call is in python/ricochet/.

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <chrono>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "callbacks.hpp"
#include "filippov.hpp"
#include "formula.hpp"
#include "formula_series.hpp"
#include "mechanism.hpp"
#include "numbers.hpp"
#include "ready.hpp"
#include "ricochet/nn/model.hpp"
#include "source.hpp"

namespace py = pybind11;

namespace {

using ricochet::python::ReadyDescription;

using Values = std::vector<double>;

/// The values of a formula, by the interpreter or by code; nothing where no code is made.
std::optional<Values> values_of(const ricochet::python::ModedFormula& of, double t, const Values& x,
                                std::size_t count, bool by_code, const Values& parameters)
{
    Values out(count), scratch;
    const ricochet::python::Formula& formula = of.in(0);
    if (!by_code) {
        formula.evaluate(t, x, parameters.data(), out, scratch);
        return out;
    }
    const ricochet::python::MachineCode code = formula.code();
    if (!code.start()) return std::nullopt;
    code.as<ricochet::python::ValuesCode>()(t, x.data(), parameters.data(), out.data());
    return out;
}

/// The coefficients of a flow and of a guard, likewise.
std::optional<std::pair<Values, Values>> series_of(const ricochet::python::ModedFormula& flow,
                                                   const ricochet::python::ModedFormula& guard,
                                                   double t, const Values& x, int order,
                                                   bool by_code)
{
    const ricochet::python::FormulaSeries series(flow, {&guard});
    ricochet::detail::LazyTape tape = series.tape(0, "formula");
    constexpr std::size_t rows = ricochet::detail::most_taylor_order + 1;
    Values out(rows * x.size()), guards(rows);
    if (!by_code) {
        tape.compute(t, x.data(), {order, out.data(), guards.data()});
    } else {
        const ricochet::python::MachineCode code = ricochet::python::code_of_series(tape);
        if (!code.start()) return std::nullopt;
        code.as<ricochet::python::SeriesCode>()(t, x.data(), order, out.data(), guards.data());
    }
    return std::pair(std::move(out), std::move(guards));
}

/// Microseconds that code for the series of a flow and a guard takes to make, and its bytes.
std::pair<double, std::size_t> time_to_make_series(const ricochet::python::ModedFormula& flow,
                                                   const ricochet::python::ModedFormula& guard)
{
    const ricochet::python::FormulaSeries series(flow, {&guard});
    const ricochet::detail::LazyTape& tape = series.tape(0, "formula");
    const auto start = std::chrono::steady_clock::now();
    const ricochet::python::MachineCode code = ricochet::python::code_of_series(tape);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - start;
    return {took.count(), code.size()};
}

py::dict described(const ricochet::KnownFunction& known)
{
    py::list arguments;
    for (const auto& each : known.arguments) {
        arguments.append(py::make_tuple(each.name, each.initial, each.whole));
    }
    return py::dict(py::arg("name") = known.name, py::arg("meaning") = known.meaning,
                    py::arg("arguments") = arguments, py::arg("many") = known.many);
}

py::dict described(const ReadyDescription& of)
{
    const ricochet::SystemDescriptor& system = *of.system;
    py::list parameters, state, known;
    for (const auto& each : system.parameters) {
        parameters.append(py::make_tuple(each.name, each.initial, each.unit, to_string(each.range),
                                         each.meaning));
    }
    for (const auto& each : system.state) {
        state.append(py::make_tuple(each.title, each.start, each.unit, each.meaning));
    }
    for (const auto& each : system.known) known.append(described(each));
    return py::dict(py::arg("name") = system.name, py::arg("type") = system.type,
                    py::arg("description") = system.description, py::arg("source") = system.source,
                    py::arg("equations") = system.equations, py::arg("parameters") = parameters,
                    py::arg("state") = state, py::arg("modes") = of.modes, py::arg("known") = known,
                    py::arg("constants") = system.constants);
}

/// One dictionary for each ready system.
py::list described_systems()
{
    py::list all;
    for (const ReadyDescription& each : ricochet::python::ready_descriptions()) {
        all.append(described(each));
    }
    return all;
}

}  // namespace

// Long: a list of what the module has.
PYBIND11_MODULE(_ricochet, module)
{
    using namespace ricochet::python;
    if (!load_numpy()) throw py::error_already_set();
    module.attr("__version__") = RICOCHET_VERSION;
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(thrown);
        } catch (const PythonError& error) {
            error.restore();
        } catch (const ricochet::ModelError& error) {
            PyErr_SetString(PyExc_ValueError, error.what());
        }
    });
    py::class_<Source, std::shared_ptr<Source>>(module, "Source")
        .def_property_readonly("guard_count",
                               [](const Source& self) { return self.guard_names().size(); })
        .def_property_readonly("guard_names", &Source::guard_names)
        .def_property_readonly("start_mode", &Source::start_mode)
        .def_property_readonly("is_free", &Source::is_free)
        .def_property(
            "parameters",
            [](const Source& self) {
                return std::map<std::string, double>(self.parameters.begin(),
                                                     self.parameters.end());
            },
            [](Source& self, const std::map<std::string, double>& given) {
                self.parameters = {given.begin(), given.end()};
            });
    bind_results(module);
    bind_places(module);
    module.def("ready_system", [](const std::string& name, const std::vector<double>& parameters) {
        return ready_system(name, parameters);
    });
    module.def("closed_form",
               [](const std::string& system, const std::string& function,
                  const std::vector<double>& parameters, const std::vector<double>& arguments) {
                   return closed_form(system, function, parameters, arguments);
               });
    module.def("ready_descriptions", &described_systems);
    using ricochet::Times;
    py::class_<Times>(module, "Times",
                      "Times of events: a list in any order, in which a time may be there twice. "
                      "``every`` makes the ticks of a clock.")
        .def(py::init([](const std::vector<double>& times) { return Times(times); }),
             py::arg("times"))
        .def("next", &Times::next, py::arg("t"), "The first time after t, or infinity.")
        .def("previous", &Times::previous, py::arg("t"), "The last time before t, or -infinity.")
        .def("count", &Times::count, py::arg("t"), "How often t is among the times.");
    module.def("every", [](double period, double phase, const std::string& name) {
        return ricochet::every(period, phase, name);
    });
    module.def("set_stop_class",
               [](const py::object& known) { stop_class() = Ref::share(known.ptr()); });
    module.def("callback_system", [](const py::dict& specification) {
        return std::shared_ptr<Source>(std::make_shared<CallbackSource>(specification.ptr()));
    });
    py::class_<FilippovSource, Source, std::shared_ptr<FilippovSource>>(module, "FilippovSource")
        .def(py::init([](const std::vector<std::shared_ptr<Source>>& fields, std::size_t surfaces,
                         bool rated, const std::optional<ricochet::Times>& times,
                         double restoring_rate) {
            return std::make_shared<FilippovSource>(
                std::vector<std::shared_ptr<const Source>>(fields.begin(), fields.end()), surfaces,
                rated, times, restoring_rate);
        }))
        .def("start_mode_at", &FilippovSource::start_mode_at)
        .def("shares", &FilippovSource::shares);
#ifdef RICOCHET_WITH_NONSMOOTH
    module.def("mechanism_system",
               [](const std::shared_ptr<Source>& beside,
                  const py::dict& specification) -> std::shared_ptr<Source> {
                   return std::make_shared<MechanismSource>(beside, specification.ptr());
               });
#endif
    using Formulas = std::vector<
        std::pair<std::vector<std::tuple<std::string, std::size_t, std::size_t, double>>,
                  std::vector<std::size_t>>>;
    py::class_<ModedFormula, std::shared_ptr<ModedFormula>>(module, "Formula")
        .def(py::init([](std::size_t components, const Formulas& modes,
                         std::vector<std::uint32_t> following) {
                 auto out = std::make_shared<ModedFormula>();
                 for (const auto& [ops, outputs] : modes)
                     out->by_mode.emplace_back(components, ops, outputs);
                 out->following = std::move(following);
                 return out;
             }),
             py::arg("components"), py::arg("modes"),
             py::arg("following") = std::vector<std::uint32_t>())
        .def("values", &values_of, py::arg("t"), py::arg("x"), py::arg("count"), py::arg("by_code"),
             py::arg("parameters") = Values())
        .def("rate",
             [](const ModedFormula& self) { return std::make_shared<ModedFormula>(self.rate()); })
        .def("series", &series_of)
        .def("time_to_make_series", &time_to_make_series);
    bind_guard_network(module);
    bind_network(module);
    bind_runs(module);
    bind_monitor(module);
    bind_ensemble(module);
}
