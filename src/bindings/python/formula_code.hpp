// The operations of formulas: their names in Python, and what they compute.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace ricochet::python {

enum class FormulaCode : std::uint8_t {
    component,  ///< component number a of the state
    time,
    constant,
    add,
    subtract,
    multiply,
    divide,
    power,
    atan2,
    hypot,
    negate,
    sqrt,
    cbrt,
    exp,
    log,
    sin,
    cos,
    tan,
    asin,
    acos,
    atan,
    sinh,
    cosh,
    tanh,
    parameter,  ///< number a
    // In gradients only.
    network,  ///< number a, whose inputs begin at b in the list of operands
    output,   ///< number b of the network's evaluation a
};

/// An operation on results of operations before it.
struct FormulaOp {
    FormulaCode code;
    std::size_t a = 0, b = 0;
    double value = 0;  ///< value, if it is a constant
};

/// Names of the operations, in the order of `FormulaCode`.
inline constexpr std::array<std::string_view, 27> formula_names{
    "component", "time",  "constant", "add",       "subtract", "multiply", "divide",
    "power",     "atan2", "hypot",    "negate",    "sqrt",     "cbrt",     "exp",
    "log",       "sin",   "cos",      "tan",       "asin",     "acos",     "atan",
    "sinh",      "cosh",  "tanh",     "parameter", "network",  "output"};

/// The result of an operation on `a` and, where it has two operands, `b`.
template <class S>
[[nodiscard]] S apply(FormulaCode code, const S& a, const S& b)
{
    using std::sin, std::cos, std::tan, std::asin, std::acos, std::atan, std::atan2;
    using std::sinh, std::cosh, std::tanh;
    using std::sqrt, std::cbrt, std::exp, std::log, std::pow, std::hypot;
    switch (code) {
        case FormulaCode::add: return a + b;
        case FormulaCode::subtract: return a - b;
        case FormulaCode::multiply: return a * b;
        case FormulaCode::divide: return a / b;
        case FormulaCode::power: return pow(a, b);
        case FormulaCode::atan2: return atan2(a, b);
        case FormulaCode::hypot: return hypot(a, b);
        case FormulaCode::negate: return -a;
        case FormulaCode::sqrt: return sqrt(a);
        case FormulaCode::cbrt: return cbrt(a);
        case FormulaCode::exp: return exp(a);
        case FormulaCode::log: return log(a);
        case FormulaCode::sin: return sin(a);
        case FormulaCode::cos: return cos(a);
        case FormulaCode::tan: return tan(a);
        case FormulaCode::asin: return asin(a);
        case FormulaCode::acos: return acos(a);
        case FormulaCode::atan: return atan(a);
        case FormulaCode::sinh: return sinh(a);
        case FormulaCode::cosh: return cosh(a);
        default: return tanh(a);
    }
}

}  // namespace ricochet::python
