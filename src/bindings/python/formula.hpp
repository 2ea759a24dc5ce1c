// Flows and guards as formulas: recorded by calling Python functions with symbols, evaluated
// without Python.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "formula_code.hpp"
#include "machine_code.hpp"

namespace ricochet::python {

/// Code that is made once something has been computed often enough without; for all threads.
template <class Function>
class LateCode {
public:
    /// The code, or null.
    [[nodiscard]] Function get() const noexcept { return code_.load(std::memory_order_acquire); }

    /// Counts one more time, and makes the code when there have been `enough`.
    template <class Make>
    void count(std::uint32_t enough, const Make& make) noexcept
    {
        if (counted_.load(std::memory_order_relaxed) >= enough) return;
        if (counted_.fetch_add(1, std::memory_order_relaxed) + 1 != enough) return;
        made_ = make();
        if (made_.start()) code_.store(made_.as<Function>(), std::memory_order_release);
    }

private:
    std::atomic<Function> code_ = nullptr;
    std::atomic<std::uint32_t> counted_ = 0;
    MachineCode made_;  ///< written by one thread
};

/// Functions of the time, the state and parameters, for scalars of any type.
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
    /// Number of parameters that it must be given.
    [[nodiscard]] std::size_t parameters() const noexcept { return parameters_; }

    /// The values for numbers, by code once there have been many.
    /// @param out  may not overlap x
    void compute(double t, const double* x, const double* parameters, double* out) const
    {
        if (const ValuesCode code = code_->get()) [[likely]]
            return code(t, x, parameters, out);
        interpret(t, x, parameters, out);
    }

    /// The derivative of the first output along x' = dxdt: a formula of twice as many components,
    /// x and then dxdt.
    [[nodiscard]] Formula rate() const;

    /// Code for `compute`, or nothing.
    [[nodiscard]] MachineCode code() const noexcept { return code_of_values(ops_, outputs_); }

    /// @param values  work space
    template <class S, class Xs, class Outputs>
    void evaluate(const S& t, const Xs& x, const double* parameters, Outputs&& out,
                  std::vector<S>& values) const
    {
        values.clear();
        for (const FormulaOp& op : ops_) values.push_back(result(op, t, x, parameters, values));
        for (std::size_t i = 0; i < outputs_.size(); ++i) out[i] = values[outputs_[i]];
    }

private:
    Formula(std::size_t components, std::size_t parameters, std::vector<FormulaOp> ops,
            std::vector<std::size_t> outputs)
        : components_(components),
          parameters_(parameters),
          ops_(std::move(ops)),
          outputs_(std::move(outputs)),
          code_(std::make_unique<LateCode<ValuesCode>>())
    {
    }

    /// By the interpreter, and makes the code when there have been enough.
    void interpret(double t, const double* x, const double* parameters, double* out) const;
    template <class S, class Xs>
    [[nodiscard]] static S result(const FormulaOp& op, const S& t, const Xs& x,
                                  const double* parameters, const std::vector<S>& values)
    {
        if (op.code == FormulaCode::component) return x[op.a];
        if (op.code == FormulaCode::time) return t;
        if (op.code == FormulaCode::constant) return S(op.value);
        if (op.code == FormulaCode::parameter) return S(parameters[op.a]);
        return apply(op.code, values[op.a], values[op.b]);
    }

    std::size_t components_;
    std::size_t parameters_ = 0;
    std::vector<FormulaOp> ops_;
    std::vector<std::size_t> outputs_;
    std::unique_ptr<LateCode<ValuesCode>> code_;
};

/// A formula for each mode.
struct ModedFormula {
    std::vector<Formula> by_mode;            ///< one for all where there are no modes
    std::vector<std::uint32_t> following{};  ///< of a reset: the mode after it, for each

    [[nodiscard]] const Formula& in(std::uint32_t mode) const noexcept
    {
        return by_mode[mode < by_mode.size() ? mode : 0];
    }
    /// Number of parameters of all modes.
    [[nodiscard]] std::size_t parameters() const noexcept;
    /// As a guard.
    [[nodiscard]] double value(std::uint32_t mode, double t, const double* x,
                               const double* parameters) const;
    /// The rate of a guard, see `Formula::rate`.
    [[nodiscard]] ModedFormula rate() const;
    /// As such a rate.
    [[nodiscard]] double value_along(std::uint32_t mode, double t, const double* x,
                                     const double* dxdt, const double* parameters) const;
    /// As a reset: x⁻ becomes x⁺; returns the next mode.
    [[nodiscard]] std::uint32_t edit(std::uint32_t mode, double t, double* x,
                                     const double* parameters) const;
};

}  // namespace ricochet::python
