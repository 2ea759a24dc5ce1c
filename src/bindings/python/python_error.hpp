// A Python exception that passes through the library.
#pragma once

#include <Python.h>

#include <memory>
#include <utility>

namespace ricochet::python {

/// An owned reference. The interpreter lock must be held to create, copy or destroy one.
class Ref {
public:
    Ref() = default;
    /// Takes over a new reference.
    [[nodiscard]] static Ref take(PyObject* object) noexcept
    {
        Ref out;
        out.object_ = object;
        return out;
    }
    [[nodiscard]] static Ref share(PyObject* object) noexcept
    {
        Py_XINCREF(object);
        return take(object);
    }
    Ref(const Ref& other) noexcept : object_(other.object_) { Py_XINCREF(object_); }
    Ref(Ref&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
    Ref& operator=(Ref other) noexcept
    {
        std::swap(object_, other.object_);
        return *this;
    }
    ~Ref() { Py_XDECREF(object_); }

    [[nodiscard]] PyObject* get() const noexcept { return object_; }
    [[nodiscard]] PyObject* release() noexcept { return std::exchange(object_, nullptr); }
    explicit operator bool() const noexcept { return object_ != nullptr; }

private:
    PyObject* object_ = nullptr;
};

/// An exception raised by a callback, fetched from the interpreter.
class PythonError {
public:
    PythonError()
    {
        PyObject *type = nullptr, *value = nullptr, *trace = nullptr;
        PyErr_Fetch(&type, &value, &trace);
        PyErr_NormalizeException(&type, &value, &trace);
        if (trace && value) PyException_SetTraceback(value, trace);
        type_ = Ref::take(type);
        value_ = Ref::take(value);
        trace_ = Ref::take(trace);
    }

    /// The exception itself.
    [[nodiscard]] PyObject* value() const noexcept { return value_.get(); }

    /// Restores the exception in the interpreter.
    void restore() const noexcept
    {
        Ref type = type_, value = value_, trace = trace_;
        PyErr_Restore(type.release(), value.release(), trace.release());
    }

private:
    Ref type_, value_, trace_;
};

/// @throws PythonError if `object` is null, which means that an exception was raised.
[[nodiscard]] inline Ref checked(PyObject* object)
{
    if (!object) throw PythonError();
    return Ref::take(object);
}

}  // namespace ricochet::python
