#include "read_request.hpp"

#include <pybind11/stl.h>

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/detect/named_detectors.hpp"
#include "network.hpp"

namespace py = pybind11;

namespace ricochet::python {

namespace {

[[nodiscard]] MethodName method_of(const std::string& name)
{
    if (const auto method = method_named(name)) return *method;
    throw py::value_error("found '" + name + "', expected 'taylor', 'rosenbrock4', " +
                          detail::spelled_methods(false, "'"));
}

[[nodiscard]] std::string_view one_of(const std::string& name,
                                      const std::vector<std::string_view>& known)
{
    for (const std::string_view candidate : known) {
        if (candidate == name) return candidate;
    }
    std::string all;
    for (const std::string_view candidate : known) {
        all += (all.empty() ? "'" : ", '") + std::string(candidate) + "'";
    }
    throw py::value_error("found '" + name + "', expected one of " + all);
}

[[nodiscard]] const std::vector<std::string_view>& known_detectors()
{
    static const std::vector<std::string_view> all = [] {
        std::vector<std::string_view> names(detail::detector_names.begin(),
                                            detail::detector_names.end());
        names.insert(names.end(), {"planned", "calibrated", "calibrated-bounds", "foreseen",
                                   "certified", "network"});
        return names;
    }();
    return all;
}

using Setter = void (*)(Request&, const py::handle&);

/// @throws py::type_error saying what was found and what was expected.
template <class T>
[[nodiscard]] T read_as(const py::handle& value)
{
    try {
        return py::cast<T>(value);
    } catch (const py::cast_error&) {
        throw py::type_error("found " + py::cast<std::string>(py::repr(value)) + ", expected " +
                             (std::is_same_v<T, bool>          ? "True or False"
                              : std::is_same_v<T, std::string> ? "a text"
                              : std::is_same_v<T, double>      ? "a number"
                              : std::is_integral_v<T>          ? "a whole number, not negative"
                                                               : "a sequence of numbers"));
    }
}

template <auto member>
void set(Request& request, const py::handle& value)
{
    using T = std::remove_cvref_t<decltype(request.options.*member)>;
    request.options.*member = read_as<T>(value);
}

template <bool Request::*flag>
void set_flag(Request& request, const py::handle& value)
{
    request.*flag = read_as<bool>(value);
}

[[nodiscard]] const std::map<std::string, Setter, std::less<>>& setters()
{
    static const std::map<std::string, Setter, std::less<>> all{
        {"t_start", &set<&Options::t_start>},
        {"t_end", &set<&Options::t_end>},
        {"mode", &set<&Options::mode>},
        {"continues", &set<&Options::continues>},
        {"step", &set<&Options::step>},
        {"rtol", &set<&Options::rtol>},
        {"atol", &set<&Options::atol>},
        {"component_atol", &set<&Options::component_atol>},
        {"h_min", &set<&Options::h_min>},
        {"h_max", &set<&Options::h_max>},
        {"event_tolerance", &set<&Options::event_tolerance>},
        {"event_rtol", &set<&Options::event_rtol>},
        {"event_window", &set<&Options::event_window>},
        {"check_inside", &set<&Options::check_inside>},
        {"look_inside", &set<&Options::check_inside>},  // its name before version 0.2
        {"stop_at_event", &set<&Options::stop_at_event>},
        {"record_events", &set<&Options::record_events>},
        {"event_states", &set<&Options::event_states>},
        {"sample_times", &set<&Options::sample_times>},
        {"max_steps", &set<&Options::max_steps>},
        {"stall_steps", &set<&Options::stall_steps>},
        {"method",
         [](Request& request, const py::handle& value) {
             const auto name = read_as<std::string>(value);
             request.by_series = name == "taylor";
             request.implicit = name == "rosenbrock4";
             if (!request.by_series && !request.implicit) request.method = method_of(name);
         }},
        {"fixed", &set_flag<&Request::fixed>},
        {"detector",
         [](Request& request, const py::handle& value) {
             request.detector = one_of(read_as<std::string>(value), known_detectors());
         }},
        {"gate",
         [](Request& request, const py::handle& value) {
             if (!value.is_none()) request.gate = py::cast<const PyNetwork&>(value).model();
         }},
        {"locator",
         [](Request& request, const py::handle& value) {
             static const std::vector<std::string_view> known{"newton", "bisection", "toms748"};
             request.locator = one_of(read_as<std::string>(value), known);
         }},
        {"events_only", &set_flag<&Request::events_only>},
        {"record_steps", &set_flag<&Request::record_steps>},
        {"dense",
         [](Request& request, const py::handle& value) {
             request.dense = request.options.record_steps = read_as<bool>(value);
         }},
    };
    return all;
}

}  // namespace

std::vector<std::string> option_names()
{
    std::vector<std::string> names;
    for (const auto& [option, set] : setters()) {
        // These three are derived in Python from other options.
        if (option != "component_atol" && option != "dense" && option != "t_end") {
            names.push_back(option);
        }
    }
    return names;
}

Request request_from(const py::dict& given)
{
    Request request;
    for (const auto& [key, value] : given) {
        const auto name = py::cast<std::string_view>(key);
        const auto setter = setters().find(name);
        if (setter == setters().end()) {
            const py::object meant = py::module_::import("ricochet._numbers").attr("meant_by");
            throw py::type_error("found an option '" + std::string(name) + "', expected some of " +
                                 py::cast<std::string>(meant(name, option_names())));
        }
        if (PyComplex_Check(value.ptr())) {  // NumPy's, too, whose imaginary part would be lost
            throw py::type_error(std::string(name) + ": found " +
                                 py::cast<std::string>(py::repr(value)) +
                                 ", expected no complex number");
        }
        try {
            setter->second(request, value);
        } catch (const py::cast_error&) {
            throw py::type_error(std::string(name) + ": found " +
                                 py::cast<std::string>(py::repr(value)) + ", expected a Network");
        } catch (const py::type_error& error) {
            throw py::type_error(std::string(name) + ": " + error.what());
        } catch (const py::value_error& error) {
            throw py::value_error(std::string(name) + ": " + error.what());
        }
    }
    const bool named = !request.by_series && !request.implicit;
    if (!request.fixed && named && !estimates_error(request.method)) {
        throw py::value_error("method: found '" + std::string(name(request.method)) +
                              "', which has no error estimate, expected fixed=True and a step "
                              "beside it, or " +
                              detail::spelled_methods(true, "'"));
    }
    return request;
}

}  // namespace ricochet::python
