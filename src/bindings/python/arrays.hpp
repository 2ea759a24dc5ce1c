// Arrays of NumPy over numbers of C++.
//
// Strides are always given. Where they are left to pybind11 before 2.12, it takes the size of an
// element from where NumPy 1 kept it, and arrays of NumPy 2 repeat their first element.
#pragma once

#include <pybind11/numpy.h>

#include <span>
#include <utility>
#include <vector>

namespace ricochet::python {

namespace py = pybind11;

/// Strides [bytes] of an array in rows, the last index running fastest.
[[nodiscard]] inline std::vector<py::ssize_t> strides_of(const std::vector<py::ssize_t>& shape,
                                                         std::size_t element)
{
    std::vector<py::ssize_t> strides(shape.size());
    auto stride = static_cast<py::ssize_t>(element);
    for (std::size_t i = shape.size(); i-- > 0; stride *= shape[i]) strides[i] = stride;
    return strides;
}

/// A new array, whose elements are not set; its memory is `mutable_data()`.
template <class T>
[[nodiscard]] py::array new_array(std::vector<py::ssize_t> shape)
{
    std::vector<py::ssize_t> strides = strides_of(shape, sizeof(T));
    return {py::dtype::of<T>(), std::move(shape), std::move(strides)};
}

/// A copy of `values`.
template <class T>
[[nodiscard]] py::array array_of(std::span<const T> values)
{
    return {py::dtype::of<T>(),
            {static_cast<py::ssize_t>(values.size())},
            {static_cast<py::ssize_t>(sizeof(T))},
            values.data()};
}
template <class T>
[[nodiscard]] py::array array_of(const std::vector<T>& values)
{
    return array_of(std::span<const T>(values));
}

/// A read-only array over memory that `owner` keeps alive.
[[nodiscard]] inline py::array view_of(const py::dtype& type, std::vector<py::ssize_t> shape,
                                       std::vector<py::ssize_t> strides, const void* data,
                                       const py::handle& owner)
{
    py::array out(type, std::move(shape), std::move(strides), data, owner);
    py::detail::array_proxy(out.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
    return out;
}

/// A read-only array over doubles in rows that `owner` keeps alive.
[[nodiscard]] inline py::array view_of(const double* data, std::vector<py::ssize_t> shape,
                                       const py::handle& owner)
{
    std::vector<py::ssize_t> strides = strides_of(shape, sizeof(double));
    return view_of(py::dtype::of<double>(), std::move(shape), std::move(strides), data, owner);
}

}  // namespace ricochet::python
