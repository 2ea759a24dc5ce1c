// Flows and guards as formulas: recorded by calling Python functions with symbols, evaluated
// without Python.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

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
};

/// An operation on results of operations before it.
struct FormulaOp {
    FormulaCode code;
    std::size_t a = 0, b = 0;
    double value = 0;  ///< value, if it is a constant
};

/// Functions of the time and the state, for scalars of any type.
class Formula {
public:
    /// @param ops      for each operation: name, first and second operand, value of a constant
    /// @param outputs  indices of the operations that are the results
    /// @throws std::invalid_argument for an unknown name, or for an operand that does not refer to
    /// an earlier operation
    Formula(std::size_t components,
            const std::vector<std::tuple<std::string, std::size_t, std::size_t, double>>& ops,
            std::vector<std::size_t> outputs);

    [[nodiscard]] std::size_t components() const noexcept { return components_; }

    /// @param values  work space
    template <class S, class Xs, class Outputs>
    void evaluate(const S& t, const Xs& x, Outputs&& out, std::vector<S>& values) const
    {
        values.clear();
        for (const FormulaOp& op : ops_) values.push_back(result(op, t, x, values));
        for (std::size_t i = 0; i < outputs_.size(); ++i) out[i] = values[outputs_[i]];
    }

private:
    template <class S, class Xs>
    [[nodiscard]] static S result(const FormulaOp& op, const S& t, const Xs& x,
                                  const std::vector<S>& values)
    {
        using std::sin, std::cos, std::tan, std::asin, std::acos, std::atan, std::atan2;
        using std::sinh, std::cosh, std::tanh;
        using std::sqrt, std::cbrt, std::exp, std::log, std::pow, std::hypot;
        if (op.code == FormulaCode::component) return x[op.a];
        if (op.code == FormulaCode::time) return t;
        if (op.code == FormulaCode::constant) return S(op.value);
        const S& a = values[op.a];
        const S& b = values[op.b];
        switch (op.code) {
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

    std::size_t components_;
    std::vector<FormulaOp> ops_;
    std::vector<std::size_t> outputs_;
};

/// A formula for each mode. Its address is passed to compiled functions as `user`.
struct ModedFormula {
    std::vector<Formula> by_mode;            ///< one for all where there are no modes
    std::vector<std::uint32_t> following{};  ///< of a reset: the mode after it, for each

    [[nodiscard]] const Formula& in(std::uint32_t mode) const noexcept
    {
        return by_mode[mode < by_mode.size() ? mode : 0];
    }
};

/// `CompiledFlow` and `CompiledGuard` that evaluate the formula at `user`.
void formula_flow(std::uint32_t mode, double t, const double* x, double* dxdt, std::size_t n,
                  void* user);
double formula_guard(std::uint32_t mode, double t, const double* x, std::size_t n, void* user);
/// The same for a `CompiledReset`.
std::uint32_t formula_reset(std::uint32_t mode, double t, double* x, std::size_t n, void* user);

}  // namespace ricochet::python
