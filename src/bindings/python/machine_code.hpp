// Code of formulas for the processor, made while a program runs.
//
// It gives the bits of the interpreters, `Formula::evaluate` and `detail::LazyTape`: the same
// operations in the same order, and calls of the same functions of the mathematical library.
// Memory is written first and executable afterwards, never both. Where code cannot be made, nothing
// is, and the interpreters go on: on processors other than x86-64 with AVX, with
// RICOCHET_CODE=0 in the environment, and where the system refuses the memory.
#pragma once

#include <cstddef>
#include <span>
#include <utility>

#include "formula_code.hpp"
#include "ricochet/taylor/detail/lazy_tape.hpp"

namespace ricochet::python {

/// Values of functions of the time, the state and parameters, into `out`, which may not overlap x.
using ValuesCode = void (*)(double t, const double* x, const double* parameters, double* out);
/// Coefficients as by `detail::LazyTape::compute`, whose number is returned.
using SeriesCode = int (*)(double t, const double* x, int order, double* out, double* guards);

/// The same of four motions, whose numbers lie side by side.
using LanesCode = int (*)(const double* t, const double* x, int order, double* out, double* guards);

/// Executable memory with a function, or nothing.
class MachineCode {
public:
    MachineCode() = default;
    /// A copy of these bytes as a function; nothing where the system refuses the memory.
    explicit MachineCode(std::span<const unsigned char> bytes) noexcept;
    MachineCode(MachineCode&& other) noexcept
        : start_(std::exchange(other.start_, nullptr)), size_(std::exchange(other.size_, 0))
    {
    }
    MachineCode& operator=(MachineCode other) noexcept
    {
        std::swap(start_, other.start_);
        std::swap(size_, other.size_);
        return *this;
    }
    ~MachineCode();

    /// Null: nothing.
    [[nodiscard]] const void* start() const noexcept { return start_; }
    template <class Function>
    [[nodiscard]] Function as() const noexcept
    {
        return reinterpret_cast<Function>(start_);
    }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }

private:
    void* start_ = nullptr;
    std::size_t size_ = 0;
};

/// Whether this build, this processor and the environment allow code.
[[nodiscard]] bool may_make_code() noexcept;

/// A `ValuesCode`, or nothing.
/// @param outputs  the operations whose results are asked for
[[nodiscard]] MachineCode code_of_values(std::span<const FormulaOp> ops,
                                         std::span<const std::size_t> outputs) noexcept;

/// A `SeriesCode`, or nothing: tapes of many operations are computed faster side by side.
[[nodiscard]] MachineCode code_of_series(const detail::LazyTape& tape) noexcept;

/// A `LanesCode`, or nothing: also where functions of the mathematical library are called.
[[nodiscard]] MachineCode code_of_lanes(const detail::LazyTape& tape) noexcept;

}  // namespace ricochet::python
