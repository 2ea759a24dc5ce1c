// Numbers returned by Python functions, and arrays passed to them.
#pragma once

#include "python_error.hpp"

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "request.hpp"

namespace ricochet::python {

/// Loads NumPy's functions, without which no other function of this header may be called. False,
/// with an ImportError set, where the module was compiled for another NumPy.
[[nodiscard]] bool load_numpy();

[[noreturn]] void raise(PyObject* type, const std::string& sentence);

/// Name of the type of an object.
[[nodiscard]] std::string type_of(PyObject* object);

/// One number that a callback has returned, or an array of one; true counts as 1, false as -1.
/// @throws PythonError naming `who` returned something else
[[nodiscard]] double as_guard(PyObject* result, const std::string& who);

/// A view of the numbers that a callback has returned; the caller keeps the result alive.
class Numbers {
public:
    /// @throws PythonError naming `who` and `of` if the result is not made of numbers
    Numbers(PyObject* result, const char* who, const std::string& of);

    [[nodiscard]] std::size_t size() const noexcept { return size_; }

    void copy(double* out) const;

    /// Copies them as values of guards: true counts as 1, false as -1.
    void copy_guards(double* out) const;

private:
    [[noreturn]] void refuse(const std::string& found) const;
    void read_array();
    void read_objects(const Ref& array);

    PyObject* result_;
    const char* who_;
    const std::string& of_;
    std::vector<double> converted_;
    PyObject** items_ = nullptr;
    const double* data_ = nullptr;
    std::size_t size_ = 0;
    bool are_truths_ = false;  ///< an array of truths
    Ref kept_;
};

/// Writes a matrix of `shape` that a callback has returned, row by row; a sparse one of SciPy is
/// filled up.
/// @throws PythonError naming `who` returned something else
void read_matrix(PyObject* result, const std::string& who, const std::array<std::size_t, 2>& shape,
                 double* rows);

/// An array, or a list of floats, that is passed to callbacks. If a callback has kept it, the next
/// call gets another one, so that the kept one does not change.
class ShownArray {
public:
    explicit ShownArray(bool as_list = false) : as_list_(as_list) {}

    [[nodiscard]] PyObject* show(const State& x);

private:
    [[nodiscard]] PyObject* show_list(const State& x);

    bool as_list_;
    Ref array_;
};

}  // namespace ricochet::python
