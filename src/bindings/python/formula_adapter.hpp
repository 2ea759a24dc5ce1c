// The adapter of a run whose flow and guards are formulas, for methods that take their derivatives.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "formula.hpp"
#include "formula_series.hpp"
#include "forwarding.hpp"
#include "ricochet/detail/stepper_adapter.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/dual.hpp"
#include "source.hpp"

namespace ricochet::python {

/// Flow and guards for any scalar; all other functions are those of a adapter to the same system.
class FormulaSystem {
public:
    static constexpr bool unchecked_names = true;
    using State = python::State;

    FormulaSystem(RunAdapter& callbacks, const FormulaSeries& series)
        : name(callbacks.table().name(callbacks.adapter())),
          callbacks_(&callbacks),
          series_(&series)
    {
    }

    std::string name;

    [[nodiscard]] RunAdapter& callbacks() const noexcept { return *callbacks_; }
    [[nodiscard]] std::size_t mode_count() const noexcept { return series_->modes(); }
    [[nodiscard]] std::size_t guard_count() const noexcept { return series_->guards().size(); }
    [[nodiscard]] const FormulaSeries& series() const noexcept { return *series_; }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return callbacks_->table().info(callbacks_->adapter(), which);
    }

    template <class S>
    void flow(Mode mode, const S& t, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        callbacks_->watch().tick();
        if constexpr (is_dual<S>) {
            // The derivative by the time is asked for once for each Jacobian.
            callbacks_->implicit().jacobians += std::ranges::any_of(t.slope, is_set);
        }
        evaluate(series_->flow().in(mode), t, x, std::span(dxdt));
    }
    template <class S>
    [[nodiscard]] S guard(std::size_t which, Mode mode, const S& t, const std::vector<S>& x) const
    {
        callbacks_->watch().tick();
        S value(0.0);
        evaluate(series_->guards()[which]->in(mode), t, x, std::span(&value, 1));
        return value;
    }

private:
    template <class S, class Outputs>
    void evaluate(const Formula& formula, const S& t, const std::vector<S>& x, Outputs&& out) const
    {
        if constexpr (std::is_same_v<S, double>) {
            formula.compute(t, x.data(), series_->parameters(), out.data());
        } else {
            thread_local std::vector<S> values;
            formula.evaluate(t, x, series_->parameters(), out, values);
        }
    }
    template <class S>
    static constexpr bool is_dual = requires(const S& s)
    {
        s.slope;
    };
    [[nodiscard]] static bool is_set(double slope) noexcept { return slope != 0; }

    RunAdapter* callbacks_;
    const FormulaSeries* series_;
};

/// @param callbacks  a adapter to the system, used for resets and all functions other than flow and
/// guards
/// @tparam Method  of the steps: `TaylorOf<0>` or `Rosenbrock4`
template <class Method>
class FormulaAdapter final : public RunAdapter {
    using Table = detail::SystemTable<State>;

public:
    FormulaAdapter(std::unique_ptr<RunAdapter> callbacks,
                   std::shared_ptr<const FormulaSeries> series, const State& x0)
        : callbacks_(std::move(callbacks)),
          series_(std::move(series)),
          table_(detail::system_table<FormulaSystem, State>),
          system_(*callbacks_, *series_),
          adapter_(system_, x0)
    {
        Forwarding<FormulaSystem>::all_but_flow_and_guards(table_, callbacks_->table());
    }

    [[nodiscard]] const Table& table() const noexcept override { return table_; }
    [[nodiscard]] void* adapter() noexcept override
    {
        return static_cast<detail::SystemAdapter<FormulaSystem, State>*>(&adapter_);
    }
    [[nodiscard]] bool is_free() const noexcept override { return callbacks_->is_free(); }
    void choose_method(detail::RunBindings<State>& setup) override;
    [[nodiscard]] SignalWatch& watch() noexcept override { return callbacks_->watch(); }
    [[nodiscard]] ImplicitCounts& implicit() noexcept override { return callbacks_->implicit(); }

private:
    std::unique_ptr<RunAdapter> callbacks_;
    std::shared_ptr<const FormulaSeries> series_;
    Table table_;
    FormulaSystem system_;
    detail::StepperAdapter<FormulaSystem, State, Method> adapter_;
};

}  // namespace ricochet::python
