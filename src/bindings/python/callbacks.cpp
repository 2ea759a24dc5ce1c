#include "callbacks.hpp"

#include <pybind11/pybind11.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "numbers.hpp"

namespace ricochet::python {

namespace {

[[nodiscard]] Ref item(PyObject* dictionary, const char* key)
{
    PyObject* found = PyDict_GetItemString(dictionary, key);  // borrowed
    return Ref::share(found ? found : Py_None);
}

[[nodiscard]] double number_in(PyObject* dictionary, const char* key, double otherwise)
{
    const Ref value = item(dictionary, key);
    if (value.get() == Py_None) return otherwise;
    const double number = PyFloat_AsDouble(value.get());
    if (number == -1 && PyErr_Occurred()) throw PythonError();
    return number;
}

[[nodiscard]] bool truth_in(PyObject* dictionary, const char* key)
{
    const int truth = PyObject_IsTrue(item(dictionary, key).get());
    if (truth < 0) throw PythonError();
    return truth != 0;
}

[[nodiscard]] std::string text_in(PyObject* dictionary, const char* key)
{
    const Ref value = item(dictionary, key);
    if (value.get() == Py_None) return {};
    const char* text = PyUnicode_AsUTF8(value.get());
    if (!text) throw PythonError();
    return text;
}

}  // namespace

Ref& stop_class() noexcept
{
    static Ref& known = *new Ref();  // outlives the interpreter
    return known;
}

Function::Function(PyObject* given, const std::string& who)
{
    if (given == Py_None) return;
    if (PyObject_HasAttrString(given, "_ricochet_address")) {
        const Ref at = checked(PyObject_GetAttrString(given, "_ricochet_address"));
        const Ref with = checked(PyObject_GetAttrString(given, "_ricochet_user"));
        address = PyLong_AsVoidPtr(at.get());
        user = PyLong_AsVoidPtr(with.get());
        if (PyErr_Occurred()) throw PythonError();
        object = Ref::share(given);  // keeps the object that the address belongs to
        return;
    }
    if (PyObject_HasAttrString(given, "_ricochet_formula")) {
        const Ref of = checked(PyObject_GetAttrString(given, "_ricochet_formula"));
        formula = pybind11::handle(of.get()).cast<const ModedFormula*>();
        object = Ref::share(given);
        return;
    }
    if (!PyCallable_Check(given)) {
        raise(PyExc_TypeError, who + ": found a " + type_of(given) + ", expected a function");
    }
    object = Ref::share(given);
}

CallbackSource::CallbackSource(PyObject* specification)
{
    if (!PyDict_Check(specification)) {
        raise(PyExc_TypeError, "found a " + type_of(specification) + ", expected a dictionary");
    }
    read_functions(specification);
    read_arguments(specification);
    read_modes(specification);
    read_guards(specification);
    if (const Ref inclusion = item(specification, "set_valued"); inclusion.get() != Py_None) {
        read_inclusion(inclusion.get());
    }
    free_ = needs_no_interpreter();
    table_.changes_dimension = truth_in(specification, "changes_dimension");
    parameter_count_ = count_parameters();
    series_ = series_of_formulas();
    small_ = may_be_small();
    fill_table();
}

void CallbackSource::read_functions(PyObject* specification)
{
    const auto function = [&](const char* key) {
        return Function(item(specification, key).get(), key);
    };
    name_ = text_in(specification, "name");
    flow_title_ = text_in(specification, "flow_title");
    if (flow_title_.empty()) flow_title_ = "flow";
    flow_ = Function(item(specification, "flow").get(), flow_title_);
    if (!flow_) raise(PyExc_TypeError, flow_title_ + ": found None, expected a function");
    jacobian_title_ = text_in(specification, "jacobian_title");
    if (jacobian_title_.empty()) jacobian_title_ = "jacobian";
    jacobian_ = Function(item(specification, "jacobian").get(), jacobian_title_);
    as_list_ = truth_in(specification, "as_list");
    guard_values_ = function("guard_values");
    reset_set_ = function("reset_set");
    next_time_event_ = function("next_time_event");
    next_time_event_at_ = function("next_time_event_at");
    previous_time_event_ = function("previous_time_event");
    time_reset_ = function("time_reset");
    if (const Ref times = item(specification, "time_events"); times.get() != Py_None) {
        times_ = pybind11::handle(times.get()).cast<Times>();
    }
}

void CallbackSource::read_arguments(PyObject* specification)
{
    const Ref arguments = item(specification, "args");
    if (arguments.get() == Py_None) return;
    const Ref sequence =
        checked(PySequence_Fast(arguments.get(), "args: expected a tuple or a list"));
    const Py_ssize_t count = PySequence_Fast_GET_SIZE(sequence.get());
    if (count > static_cast<Py_ssize_t>(most_arguments) - 8) {
        raise(PyExc_ValueError,
              "args: found " + std::to_string(count) + " arguments, expected at most 24");
    }
    for (Py_ssize_t i = 0; i < count; ++i) {
        arguments_.push_back(Ref::share(PySequence_Fast_GET_ITEM(sequence.get(), i)));
    }
}

void CallbackSource::read_modes(PyObject* specification)
{
    mode_list_ = item(specification, "modes");
    moded_ = mode_list_.get() != Py_None;
    if (!moded_) {
        mode_list_ = Ref();
        return;
    }
    mode_count_ = static_cast<std::size_t>(PyList_GET_SIZE(mode_list_.get()));
    if (mode_count_ == 0) raise(PyExc_ValueError, "modes: found none, expected at least one");
    mode_numbers_ = checked(PyDict_New());
    for (std::size_t i = 0; i < mode_count_; ++i) {
        const Ref number = checked(PyLong_FromSize_t(i));
        if (PyDict_SetItem(mode_numbers_.get(),
                           PyList_GET_ITEM(mode_list_.get(), static_cast<Py_ssize_t>(i)),
                           number.get()) != 0) {
            throw PythonError();
        }
    }
    if (PyDict_Size(mode_numbers_.get()) != PyList_GET_SIZE(mode_list_.get())) {
        const Ref text = checked(PyObject_Repr(mode_list_.get()));
        raise(PyExc_ValueError, std::string("modes: found ") + PyUnicode_AsUTF8(text.get()) +
                                    ", expected each of them once");
    }
}

void CallbackSource::read_guards(PyObject* specification)
{
    const Ref guards = item(specification, "guards");
    if (guards.get() == Py_None) return;
    const auto count = static_cast<std::size_t>(PyList_GET_SIZE(guards.get()));
    guards_.reserve(count);  // pointers to the names must stay valid
    for (std::size_t i = 0; i < count; ++i) {
        read_guard(PyList_GET_ITEM(guards.get(), static_cast<Py_ssize_t>(i)));
    }
}

bool CallbackSource::needs_no_interpreter() const
{
    const auto is_free = [](const Function& f) { return !f || f.is_free(); };
    bool free = is_free(flow_) && is_free(jacobian_) && !guard_values_ && !reset_set_ &&
                !next_time_event_ && !next_time_event_at_ && !previous_time_event_ &&
                is_free(time_reset_) && !inclusion_;
    for (const CallbackGuard& guard : guards_) {
        free = free && is_free(guard.value) && is_free(guard.rate) && is_free(guard.reset) &&
               is_free(guard.rest) && !guard.enabled && is_free(guard.speed_bound) &&
               is_free(guard.acceleration_bound) && is_free(guard.lower_bound) &&
               is_free(guard.upper_bound);
    }
    return free;
}

std::size_t CallbackSource::count_parameters() const
{
    std::size_t count = 0;
    const auto add = [&](const Function& of) {
        if (of.formula) count = std::max(count, of.formula->parameters());
    };
    add(flow_);
    add(time_reset_);
    for (const CallbackGuard& guard : guards_) {
        for (const Function* of : {&guard.value, &guard.reset, &guard.rest}) add(*of);
    }
    return count;
}

std::shared_ptr<const FormulaSeries> CallbackSource::series_of_formulas(
    const double* parameters) const
{
    std::vector<const ModedFormula*> guards;
    for (const CallbackGuard& guard : guards_) guards.push_back(guard.value.formula);
    const bool all = std::ranges::find(guards, nullptr) == guards.end();
    if (!all || !flow_.formula) return nullptr;
    return std::make_shared<const FormulaSeries>(*flow_.formula, std::move(guards), parameters);
}

bool CallbackSource::may_be_small() const
{
    bool may = free_ && !jacobian_ && !table_.changes_dimension;
    for (const CallbackGuard& guard : guards_) {
        may = may && !guard.rate && !guard.speed_bound && !guard.acceleration_bound &&
              !guard.lower_bound && !guard.upper_bound;
    }
    return may;
}

void CallbackSource::read_guard(PyObject* specification)
{
    CallbackGuard& guard = guards_.emplace_back();
    const auto function = [&](const char* key) {
        return Function(item(specification, key).get(), std::string(key) + " of " + guard.owner);
    };
    guard.name = text_in(specification, "name");
    guard.title = guard.owner = text_in(specification, "title");
    if (guard.title.empty()) {
        guard.title = "guard " + guard.name;
        // One without a name is called by its number.
        guard.owner = guard.name == std::to_string(guards_.size() - 1) ? guard.title : guard.name;
    }
    guard.value = Function(item(specification, "value").get(), guard.title);
    guard.rate = function("rate");
    if (!guard.rate && guard.value.formula && !truth_in(specification, "boolean")) {
        guard.derived = std::make_shared<const ModedFormula>(guard.value.formula->rate());
    }
    guard.reset = function("reset");
    guard.rest = function("rest");
    guard.enabled = function("enabled");
    guard.speed_bound = function("speed_bound");
    guard.acceleration_bound = function("acceleration_bound");
    guard.lower_bound = function("lower_bound");
    guard.upper_bound = function("upper_bound");
    guard.lipschitz = number_in(specification, "lipschitz", 1);
    guard.directed = truth_in(specification, "directed");
    if (guard.directed && (!guard.reset || guard.reset.is_free())) {
        raise(PyExc_ValueError, guard.title + ": found directed, expected a reset in Python");
    }
    if (!guard.value && !guard_values_) {
        raise(PyExc_TypeError, guard.title + ": found None, expected a function");
    }
    if (guard.rest && !guard.reset && !reset_set_) {
        raise(PyExc_ValueError, guard.title + ": found a rest without a reset, expected both");
    }
    const double direction = number_in(specification, "direction", 0);
    guard.info = {
        .name = guard.name == std::to_string(guards_.size() - 1) ? std::string_view()
                                                                 : std::string_view(guard.name),
        .crossing = direction < 0   ? Crossing::falling
                    : direction > 0 ? Crossing::rising
                                    : Crossing::either,
        .resets = guard.reset || (reset_set_ && truth_in(specification, "resets")),
        .stop_after = static_cast<std::uint32_t>(number_in(specification, "stop_after", 0)),
        .unilateral = truth_in(specification, "unilateral"),
        .boolean = truth_in(specification, "boolean"),
        .degree = static_cast<int>(number_in(specification, "degree", 0)),
        .touch = number_in(specification, "touch", 0),
        .at_start = truth_in(specification, "at_start"),
        .at_entry = truth_in(specification, "at_entry")};
    guard.in_mode = modes_in(specification, guard.title);
}

std::vector<bool> CallbackSource::modes_in(PyObject* specification, const std::string& title) const
{
    const Ref modes = item(specification, "in_modes");
    if (modes.get() == Py_None) return {};
    if (!moded_) {
        raise(PyExc_ValueError,
              title + ": found in_modes, expected none in a system without modes");
    }
    std::vector<bool> in_mode(mode_count_, false);
    for (Py_ssize_t i = 0; i < PyList_GET_SIZE(modes.get()); ++i) {
        PyObject* number =
            PyDict_GetItemWithError(mode_numbers_.get(), PyList_GET_ITEM(modes.get(), i));
        if (!number) {
            PyErr_Clear();
            const Ref text = checked(PyObject_Repr(PyList_GET_ITEM(modes.get(), i)));
            const Ref known = checked(PyObject_Repr(mode_list_.get()));
            raise(PyExc_ValueError, title + ": found the mode " + PyUnicode_AsUTF8(text.get()) +
                                        ", which the system does not have, expected some of " +
                                        PyUnicode_AsUTF8(known.get()));
        }
        in_mode[PyLong_AsSize_t(number)] = true;
    }
    return in_mode;
}

void CallbackSource::read_inclusion(PyObject* specification)
{
    CallbackInclusion& of = inclusion_.emplace();
    const auto function = [&](const char* key) {
        return Function(item(specification, key).get(), std::string(key) + " of set_valued");
    };
    of.smooth = function("smooth");
    of.bounds = function("bounds");
    of.offset = function("offset");
    of.offset_rate = function("offset_rate");
    of.change = function("change");
    of.start_mode = function("start_mode");
    of.static_bounds = function("static_bounds");
    const auto matrix = [&](const char* key) {
        const Ref rows = item(specification, key);
        std::vector<double> out;
        if (rows.get() == Py_None) return out;
        for (Py_ssize_t i = 0; i < PyList_GET_SIZE(rows.get()); ++i) {
            out.push_back(PyFloat_AsDouble(PyList_GET_ITEM(rows.get(), i)));
            if (PyErr_Occurred()) throw PythonError();
        }
        return out;
    };
    of.matrices.mass = matrix("mass");
    of.matrices.observe = matrix("observe");
    of.matrices.act = matrix("act");
    of.components = static_cast<std::size_t>(number_in(specification, "components", 0));
    of.reactions = static_cast<std::size_t>(number_in(specification, "reactions", 1));
    of.in_mode = modes_in(specification, "set_valued");
    const Ref stands_for = item(specification, "stands_for");
    if (stands_for.get() == Py_None) return;
    const auto count = static_cast<std::size_t>(PyList_GET_SIZE(stands_for.get()));
    if (count != guards_.size()) {
        raise(PyExc_ValueError, "stands_for of set_valued: found " + std::to_string(count) +
                                    " of them, expected one for each of " +
                                    std::to_string(guards_.size()) + " guards");
    }
    for (std::size_t i = 0; i < count; ++i) {
        PyObject* reaction = PyList_GET_ITEM(stands_for.get(), static_cast<Py_ssize_t>(i));
        if (reaction == Py_None) continue;
        guards_[i].info.reaction = PyLong_AsSize_t(reaction);
        if (PyErr_Occurred()) throw PythonError();
    }
}

std::vector<std::string> CallbackSource::mode_names() const
{
    return {};  // Python keeps the mode objects themselves
}

std::vector<std::string> CallbackSource::guard_names() const
{
    std::vector<std::string> names;
    for (const CallbackGuard& guard : guards_) names.push_back(guard.name);
    return names;
}

}  // namespace ricochet::python
