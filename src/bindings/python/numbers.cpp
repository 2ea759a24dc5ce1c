#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include "numbers.hpp"

#include <numpy/arrayobject.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace ricochet::python {

namespace {

/// Whether `result` is a truth, or an array of one, such as `x > 0` of a state with one component.
bool is_truth(PyObject* result)
{
    if (PyBool_Check(result) || PyArray_IsScalar(result, Bool)) return true;
    if (!PyArray_Check(result)) return false;
    auto* array = reinterpret_cast<PyArrayObject*>(result);
    return PyArray_TYPE(array) == NPY_BOOL && PyArray_SIZE(array) == 1;
}

}  // namespace

bool load_numpy()
{
    if (_import_array() >= 0) return true;
    PyErr_Clear();
    const Ref numpy = Ref::take(PyImport_ImportModule("numpy"));
    const Ref version =
        Ref::take(numpy ? PyObject_GetAttrString(numpy.get(), "__version__") : nullptr);
    if (!version) return false;
    const char* const with = NPY_VERSION >= 0x02000000 ? "2" : "1";
    PyErr_Format(PyExc_ImportError,
                 "ricochet: found NumPy %S and a module that was compiled with NumPy %s; expected "
                 "one that was compiled with NumPy 2, which runs with either",
                 version.get(), with);
    return false;
}

void raise(PyObject* type, const std::string& sentence)
{
    PyErr_SetString(type, sentence.c_str());
    throw PythonError();
}

std::string type_of(PyObject* object)
{
    return object == Py_None ? "None" : Py_TYPE(object)->tp_name;
}

double as_guard(PyObject* result, const std::string& who)
{
    if (PyFloat_Check(result)) return PyFloat_AS_DOUBLE(result);
    if (is_truth(result)) return PyObject_IsTrue(result) ? 1 : -1;
    if (PyArray_Check(result)) {
        // NumPy turns an array into a float only where it has no dimensions.
        auto* array = reinterpret_cast<PyArrayObject*>(result);
        if (PyArray_SIZE(array) != 1) {
            raise(PyExc_TypeError, who + " returned an array of " +
                                       std::to_string(PyArray_SIZE(array)) +
                                       " numbers, expected a number");
        }
        const Ref element = checked(PyArray_ToScalar(PyArray_DATA(array), array));
        if (!PyArray_Check(element.get())) return as_guard(element.get(), who);
    }
    if (!PyComplex_Check(result) && !PyArray_IsScalar(result, ComplexFloating) &&
        result != Py_None) {
        const double number = PyFloat_AsDouble(result);
        if (number != -1 || !PyErr_Occurred()) return number;
        if (!PyErr_ExceptionMatches(PyExc_TypeError) && !PyErr_ExceptionMatches(PyExc_ValueError)) {
            throw PythonError();
        }
        PyErr_Clear();
    }
    raise(PyExc_TypeError, who + " returned " + type_of(result) + ", expected a number");
}

Numbers::Numbers(PyObject* result, const char* who, const std::string& of)
    : result_(result), who_(who), of_(of)
{
    if (PyList_CheckExact(result) || PyTuple_CheckExact(result)) {
        items_ = PySequence_Fast_ITEMS(result);
        size_ = static_cast<std::size_t>(PySequence_Fast_GET_SIZE(result));
        for (std::size_t i = 0; i < size_; ++i) {
            if (!PyFloat_Check(items_[i]) && !PyLong_Check(items_[i])) {
                items_ = nullptr;  // let NumPy see whether these are numbers
                break;
            }
        }
        if (items_) return;
    }
    read_array();
}

void Numbers::copy(double* out) const
{
    for (std::size_t i = 0; i < size_; ++i) {
        if (!items_) {
            out[i] = data_[i];
        } else if (PyFloat_Check(items_[i])) {
            out[i] = PyFloat_AS_DOUBLE(items_[i]);
        } else {
            out[i] = PyLong_AsDouble(items_[i]);
            if (out[i] == -1 && PyErr_Occurred()) {
                PyErr_Clear();
                refuse("an integer above all floats");
            }
        }
    }
}

void Numbers::copy_guards(double* out) const
{
    copy(out);
    if (are_truths_) {
        std::replace(out, out + size_, 0.0, -1.0);
    } else if (PyList_Check(result_) || PyTuple_Check(result_)) {
        PyObject** items = PySequence_Fast_ITEMS(result_);
        const auto count = static_cast<std::size_t>(PySequence_Fast_GET_SIZE(result_));
        for (std::size_t i = 0; i < std::min(size_, count); ++i) {
            if (out[i] == 0 && is_truth(items[i])) out[i] = -1;
        }
    }
}

void Numbers::refuse(const std::string& found) const
{
    raise(PyExc_TypeError,
          std::string(who_) + of_ + " returned " + found + ", expected a sequence of numbers");
}

void Numbers::read_array()
{
    if (result_ == Py_None) refuse("None");
    Ref array = Ref::take(PyArray_FromAny(result_, nullptr, 0, 0, 0, nullptr));
    if (!array) {
        const PythonError error;
        if (!PyErr_GivenExceptionMatches(error.value(), PyExc_ValueError) &&
            !PyErr_GivenExceptionMatches(error.value(), PyExc_TypeError)) {
            throw PythonError(error);
        }
        refuse("a " + type_of(result_));
    }
    auto* given = reinterpret_cast<PyArrayObject*>(array.get());
    const int type = PyArray_TYPE(given);
    if (PyTypeNum_ISCOMPLEX(type)) refuse("complex numbers");
    if (PyTypeNum_ISFLEXIBLE(type) || PyTypeNum_ISDATETIME(type)) {
        refuse("a " + type_of(result_));
    }
    if (PyArray_NDIM(given) > 1) {
        raise(PyExc_ValueError, std::string(who_) + of_ + " returned an array of " +
                                    std::to_string(PyArray_NDIM(given)) +
                                    " dimensions, expected 1");
    }
    if (type == NPY_OBJECT) return read_objects(array);
    are_truths_ = type == NPY_BOOL;
    if (type != NPY_DOUBLE || !PyArray_ISCARRAY_RO(given)) {
        array = Ref::take(PyArray_FromAny(array.get(), PyArray_DescrFromType(NPY_DOUBLE), 0, 1,
                                          NPY_ARRAY_CARRAY_RO | NPY_ARRAY_FORCECAST, nullptr));
        if (!array) {
            PyErr_Clear();
            refuse("a " + type_of(result_));
        }
        given = reinterpret_cast<PyArrayObject*>(array.get());
    }
    data_ = static_cast<const double*>(PyArray_DATA(given));
    size_ = static_cast<std::size_t>(PyArray_SIZE(given));
    kept_ = std::move(array);
}

void Numbers::read_objects(const Ref& array)
{
    const Ref list = checked(PyArray_ToList(reinterpret_cast<PyArrayObject*>(array.get())));
    if (!PyList_Check(list.get())) refuse("a " + type_of(result_));
    for (Py_ssize_t i = 0; i < PyList_GET_SIZE(list.get()); ++i) {
        PyObject* item = PyList_GET_ITEM(list.get(), i);
        // NumPy's complex numbers would be converted without their imaginary parts.
        const bool is_complex = PyComplex_Check(item) || PyArray_IsScalar(item, ComplexFloating);
        converted_.push_back(is_complex ? 0 : PyFloat_AsDouble(item));
        if (is_complex || PyErr_Occurred()) {
            PyErr_Clear();
            refuse("a " + type_of(result_) + " with a " + type_of(item));
        }
    }
    data_ = converted_.data();
    size_ = converted_.size();
}

void read_matrix(PyObject* result, const std::string& who, const std::array<std::size_t, 2>& shape,
                 double* rows)
{
    Ref given = Ref::share(result);
    if (PyObject_HasAttrString(result, "toarray")) {
        given = checked(PyObject_CallMethod(result, "toarray", nullptr));
    }
    const std::string expected = ", expected an array of shape (" + std::to_string(shape[0]) +
                                 ", " + std::to_string(shape[1]) + ")";
    const Ref any = given.get() == Py_None
                        ? Ref()
                        : Ref::take(PyArray_FromAny(given.get(), nullptr, 0, 0, 0, nullptr));
    auto* array = reinterpret_cast<PyArrayObject*>(any.get());
    const bool is_real = array && !PyTypeNum_ISCOMPLEX(PyArray_TYPE(array)) &&
                         !PyTypeNum_ISFLEXIBLE(PyArray_TYPE(array)) &&
                         !PyTypeNum_ISDATETIME(PyArray_TYPE(array));
    const Ref numbers =
        is_real ? Ref::take(PyArray_FromAny(any.get(), PyArray_DescrFromType(NPY_DOUBLE), 0, 0,
                                            NPY_ARRAY_CARRAY_RO | NPY_ARRAY_FORCECAST, nullptr))
                : Ref();
    if (!numbers) {
        PyErr_Clear();
        raise(PyExc_TypeError, who + " returned a " + type_of(result) + expected);
    }
    array = reinterpret_cast<PyArrayObject*>(numbers.get());
    const bool fits = PyArray_NDIM(array) == 2 &&
                      PyArray_DIM(array, 0) == static_cast<npy_intp>(shape[0]) &&
                      PyArray_DIM(array, 1) == static_cast<npy_intp>(shape[1]);
    // Of one component a number is enough, as for SciPy's LSODA.
    const std::size_t count = shape[0] * shape[1];
    if (!fits && !(count == 1 && PyArray_SIZE(array) == 1)) {
        const Ref found = checked(PyObject_GetAttrString(numbers.get(), "shape"));
        const Ref text = checked(PyObject_Str(found.get()));
        raise(PyExc_ValueError,
              who + " returned the shape " + PyUnicode_AsUTF8(text.get()) + expected);
    }
    std::memcpy(rows, PyArray_DATA(array), count * sizeof(double));
}

PyObject* ShownArray::show_list(const State& x)
{
    const auto size = static_cast<Py_ssize_t>(x.size());
    PyObject* list = array_.get();
    if (!list || Py_REFCNT(list) != 1 || PyList_GET_SIZE(list) != size) {
        array_ = checked(PyList_New(size));
        list = array_.get();
    }
    for (Py_ssize_t i = 0; i < size; ++i) {
        PyObject* number = PyFloat_FromDouble(x[static_cast<std::size_t>(i)]);
        if (!number) throw PythonError();
        PyList_SetItem(list, i, number);  // takes it, and drops the one that was there
    }
    return list;
}

PyObject* ShownArray::show(const State& x)
{
    if (as_list_) return show_list(x);
    auto* array = reinterpret_cast<PyArrayObject*>(array_.get());
    const auto size = static_cast<npy_intp>(x.size());
    if (!array || Py_REFCNT(array) != 1 || PyArray_NDIM(array) != 1 ||
        PyArray_DIM(array, 0) != size || PyArray_TYPE(array) != NPY_DOUBLE ||
        !PyArray_ISCARRAY(array)) {
        npy_intp shape = size;
        array_ = checked(PyArray_SimpleNew(1, &shape, NPY_DOUBLE));
        array = reinterpret_cast<PyArrayObject*>(array_.get());
    }
    std::memcpy(PyArray_DATA(array), x.data(), x.size() * sizeof(double));
    return array_.get();
}

}  // namespace ricochet::python
