// A system made of functions of Python, or of addresses of compiled ones.
#pragma once

#include "python_error.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formula.hpp"
#include "formula_series.hpp"
#include "nonsmooth/sized_inclusion.hpp"
#include "source.hpp"

namespace ricochet::python {

// Signatures of compiled functions. A reset returns the next mode.
using CompiledFlow = void (*)(std::uint32_t mode, double t, const double* x, double* dxdt,
                              std::size_t n, void* user);
using CompiledGuard = double (*)(std::uint32_t mode, double t, const double* x, std::size_t n,
                                 void* user);
using CompiledRate = double (*)(std::uint32_t mode, double t, const double* x, const double* dxdt,
                                std::size_t n, void* user);
using CompiledReset = std::uint32_t (*)(std::uint32_t mode, double t, double* x, std::size_t n,
                                        void* user);

/// A function of the user's: an object to be called, or one that is called without the interpreter:
/// a formula, or the address of a compiled function, with `user` as its last argument.
struct Function {
    Ref object;
    void* address = nullptr;
    void* user = nullptr;
    const ModedFormula* formula = nullptr;

    Function() = default;
    /// Takes a Python object. None stands for no function. An object with `_ricochet_address` is a
    /// compiled function, one with `_ricochet_formula` a formula.
    /// @throws PythonError naming `who` if the object is something else
    Function(PyObject* given, const std::string& who);

    explicit operator bool() const noexcept { return bool(object); }
    [[nodiscard]] bool is_free() const noexcept { return address || formula; }

    // Of functions that are free; formulas are given the parameters.

    void flow(Mode mode, double t, const double* x, double* dxdt, std::size_t n,
              const double* parameters) const
    {
        if (formula) return formula->in(mode).compute(t, x, parameters, dxdt);
        reinterpret_cast<CompiledFlow>(address)(mode, t, x, dxdt, n, user);
    }
    [[nodiscard]] double value(Mode mode, double t, const double* x, std::size_t n,
                               const double* parameters) const
    {
        if (formula) return formula->value(mode, t, x, parameters);
        return reinterpret_cast<CompiledGuard>(address)(mode, t, x, n, user);
    }
    /// Returns the next mode.
    [[nodiscard]] Mode edit(Mode mode, double t, double* x, std::size_t n,
                            const double* parameters) const
    {
        if (formula) return formula->edit(mode, t, x, parameters);
        return reinterpret_cast<CompiledReset>(address)(mode, t, x, n, user);
    }
};

/// The class `Stop` of Python, an instance of which ends a run; null before it is known.
[[nodiscard]] Ref& stop_class() noexcept;

/// Most arguments of a call, further ones included.
constexpr std::size_t most_arguments = 32;

struct CallbackGuard {
    std::string name;
    std::string title;  ///< in messages: "guard floor", "events[0]"
    std::string owner;  ///< name in messages about its reset and other functions: "floor"
    GuardInfo info;
    Function value, rate, reset, rest, enabled;
    Function speed_bound, acceleration_bound, lower_bound, upper_bound;
    std::shared_ptr<const ModedFormula> derived;  ///< the rate of a formula, where none is given
    double lipschitz = 1;

    [[nodiscard]] bool is_rated() const noexcept { return rate || derived; }

    bool directed = false;      ///< the reset takes the direction of the crossing
    std::vector<bool> in_mode;  ///< empty: in every mode
};

/// Set-valued motion.
struct CallbackInclusion {
    Function smooth, bounds, offset, offset_rate, change, start_mode, static_bounds;
    detail::SizedMatrices matrices;
    std::size_t components = 0;  ///< of the matrices; 0: none is given
    std::size_t reactions = 1;
    std::vector<bool> in_mode;  ///< empty: in every mode
};

class CallbackSource final : public Source {
public:
    /// @param specification  a dictionary that `System` in Python makes
    /// @throws PythonError if something in it is missing, or of another type
    explicit CallbackSource(PyObject* specification);

    /// @throws std::invalid_argument for a start that does not fit its formulas
    [[nodiscard]] std::unique_ptr<RunAdapter> open(const State& x0) const override;
    [[nodiscard]] std::unique_ptr<RunAdapter> open_by_series(const State& x0) const override;
    [[nodiscard]] std::unique_ptr<RunAdapter> open_implicit(const State& x0) const override;
    [[nodiscard]] std::unique_ptr<RunAdapter> open_for(const Request& request,
                                                       const State& x0) const override;
    [[nodiscard]] bool is_free() const noexcept override { return free_; }
    [[nodiscard]] std::size_t parameter_count() const noexcept override { return parameter_count_; }
    [[nodiscard]] std::vector<std::string> mode_names() const override;
    [[nodiscard]] std::vector<std::string> guard_names() const override;
    /// By the loop for up to four components, where no function needs the interpreter.
    [[nodiscard]] std::optional<Record> run_whole(const State& x0, const Request& request,
                                                  SignalWatch& watch) const override;
    /// Formulas by Taylor's method, of one mode and one guard at most.
    [[nodiscard]] bool runs_side_by_side(const Request& request, std::size_t n) const override;
    void run_side_by_side(const Request& request, const Rows& rows) const override;

private:
    friend class CallbackAdapter;
    friend class SmallSystem;

    void read_functions(PyObject* specification);
    void read_arguments(PyObject* specification);
    void read_modes(PyObject* specification);
    void read_guards(PyObject* specification);
    void read_guard(PyObject* specification);
    void read_inclusion(PyObject* specification);
    /// Whether each mode is among those that a specification names; empty if it names none.
    [[nodiscard]] std::vector<bool> modes_in(PyObject* specification,
                                             const std::string& title) const;
    /// Whether no function that a run calls needs the interpreter.
    [[nodiscard]] bool needs_no_interpreter() const;
    void fill_table();
    [[nodiscard]] std::size_t count_parameters() const;
    /// The series of flow and guards; null if one of them is no formula.
    [[nodiscard]] std::shared_ptr<const FormulaSeries> series_of_formulas(
        const double* parameters = nullptr) const;
    /// The series of a run: without parameters, the one of all runs.
    [[nodiscard]] std::shared_ptr<const FormulaSeries> series_for(const Request& request) const
    {
        return request.parameters && series_ ? series_of_formulas(request.parameters) : series_;
    }
    /// @throws std::invalid_argument for a start, or no parameters, that do not fit its formulas
    void require_size(const State& x0, const double* parameters = nullptr) const;
    /// Whether the loop for a few components can run it.
    [[nodiscard]] bool may_be_small() const;

    std::string name_;
    std::string flow_title_;      ///< in messages: "flow", "fun"
    std::string jacobian_title_;  ///< "jacobian", "jac"
    Function flow_, jacobian_, guard_values_, reset_set_;
    Function next_time_event_, next_time_event_at_, previous_time_event_, time_reset_;
    std::optional<Times> times_;  ///< a list of time events, or a clock
    std::vector<CallbackGuard> guards_;
    std::optional<CallbackInclusion> inclusion_;
    std::vector<Ref> arguments_;    ///< the user's further arguments of every function
    Ref mode_list_, mode_numbers_;  ///< names of the modes and their numbers; null without modes
    std::size_t mode_count_ = 0;
    bool moded_ = false;
    bool as_list_ = false;  ///< states are passed as lists of floats
    bool free_ = false;     ///< whether none of its functions needs the interpreter
    bool small_ = false;    ///< see `may_be_small`
    std::size_t parameter_count_ = 0;
    std::shared_ptr<const FormulaSeries> series_;
    detail::SystemTable<State> table_;
};

}  // namespace ricochet::python
