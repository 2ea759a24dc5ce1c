#include "places.hpp"

#include <pybind11/pybind11.h>

#include <cstring>

#include "bindings.hpp"

namespace ricochet::python {

namespace {

/// Stands for an item that a dictionary did not have.
[[nodiscard]] PyObject* absent()
{
    static PyObject* const object =
        PyObject_CallNoArgs(reinterpret_cast<PyObject*>(&PyBaseObject_Type));
    return object;
}

/// @param now  null where there is nothing
[[nodiscard]] bool is_same(PyObject* now, PyObject* then)
{
    if (now == then) return true;
    if (!now) return then == absent();
    if (PyFloat_CheckExact(now) && PyFloat_CheckExact(then)) {
        const double a = PyFloat_AS_DOUBLE(now), b = PyFloat_AS_DOUBLE(then);
        return std::memcmp(&a, &b, sizeof a) == 0;
    }
    const bool comparable = (PyLong_CheckExact(now) && PyLong_CheckExact(then)) ||
                            (PyUnicode_CheckExact(now) && PyUnicode_CheckExact(then));
    return comparable && PyObject_RichCompareBool(now, then, Py_EQ) == 1;
}

[[nodiscard]] bool has_items(PyObject* dictionary, PyObject* then)
{
    if (PyDict_GET_SIZE(dictionary) != PyDict_GET_SIZE(then)) return false;
    PyObject *key = nullptr, *value = nullptr;
    for (Py_ssize_t at = 0; PyDict_Next(then, &at, &key, &value);) {
        PyObject* const now = PyDict_GetItemWithError(dictionary, key);
        if (!now || !is_same(now, value)) return false;
    }
    return true;
}

[[nodiscard]] bool has_elements(PyObject* list, PyObject* then)
{
    const Py_ssize_t count = PyList_GET_SIZE(list);
    if (count != PyTuple_GET_SIZE(then)) return false;
    for (Py_ssize_t i = 0; i < count; ++i) {
        if (!is_same(PyList_GET_ITEM(list, i), PyTuple_GET_ITEM(then, i))) return false;
    }
    return true;
}

[[nodiscard]] bool has_numbers(PyObject* array, PyObject* shape, PyObject* then)
{
    Py_buffer view;
    if (PyObject_GetBuffer(array, &view, PyBUF_C_CONTIGUOUS) != 0) return false;
    bool same =
        view.len == PyBytes_GET_SIZE(then) && view.ndim == PyTuple_GET_SIZE(shape) &&
        std::memcmp(view.buf, PyBytes_AS_STRING(then), static_cast<std::size_t>(view.len)) == 0;
    for (int i = 0; same && i < view.ndim; ++i) {
        same = view.shape[i] == PyLong_AsSsize_t(PyTuple_GET_ITEM(shape, i));
    }
    PyBuffer_Release(&view);
    return same;
}

[[nodiscard]] bool has_parts(PyObject* function, PyObject* code, PyObject* then)
{
    const auto or_none = [](PyObject* object) { return object ? object : Py_None; };
    return PyFunction_GET_CODE(function) == code &&
           or_none(PyFunction_GET_DEFAULTS(function)) == PyTuple_GET_ITEM(then, 0) &&
           or_none(PyFunction_GET_KW_DEFAULTS(function)) == PyTuple_GET_ITEM(then, 1);
}

/// In the order of their numbers in `_kept.py`.
enum class Kind : long { cell, item, list, dictionary, type, array, function };

[[nodiscard]] bool is_unchanged(PyObject* place)
{
    const auto kind = static_cast<Kind>(PyLong_AsLong(PyTuple_GET_ITEM(place, 0)));
    PyObject* const object = PyTuple_GET_ITEM(place, 1);
    PyObject* const key = PyTuple_GET_ITEM(place, 2);
    PyObject* const then = PyTuple_GET_ITEM(place, 3);
    switch (kind) {
        case Kind::cell: return is_same(PyCell_GET(object), then);
        case Kind::item: return is_same(PyDict_GetItemWithError(object, key), then);
        case Kind::list: return has_elements(object, then);
        case Kind::dictionary: return has_items(object, then);
        case Kind::type: return has_items(reinterpret_cast<PyTypeObject*>(object)->tp_dict, then);
        case Kind::array: return has_numbers(object, key, then);
        case Kind::function: return has_parts(object, key, then);
    }
    return false;
}

}  // namespace

bool are_unchanged(PyObject* places)
{
    for (Py_ssize_t i = 0; i < PyTuple_GET_SIZE(places); ++i) {
        if (is_unchanged(PyTuple_GET_ITEM(places, i))) continue;
        PyErr_Clear();  // an exception of a comparison
        return false;
    }
    return true;
}

void bind_places(pybind11::module_& module)
{
    module.attr("absent") = pybind11::reinterpret_borrow<pybind11::object>(absent());
    module.def("unchanged",
               [](const pybind11::tuple& places) { return are_unchanged(places.ptr()); });
}

}  // namespace ricochet::python
