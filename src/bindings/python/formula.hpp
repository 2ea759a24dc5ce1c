// Flows and guards as formulas: recorded by calling Python functions with symbols, evaluated
// without Python.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "formula_code.hpp"

namespace ricochet::python {

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
        if (op.code == FormulaCode::component) return x[op.a];
        if (op.code == FormulaCode::time) return t;
        if (op.code == FormulaCode::constant) return S(op.value);
        return apply(op.code, values[op.a], values[op.b]);
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
