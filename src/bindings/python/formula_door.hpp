// The door of a run whose flow and guards are formulas, by power series.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "formula.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/taylor/taylor.hpp"
#include "source.hpp"

namespace ricochet::python {

/// Flow and guards for any scalar; all other functions are those of a door to the same system.
class FormulaSystem {
public:
    static constexpr bool unchecked_names = true;
    using State = python::State;

    FormulaSystem(RunDoor& callbacks, const ModedFormula& flow,
                  std::vector<const ModedFormula*> guards, std::size_t modes)
        : name(callbacks.table().name(callbacks.door())),
          callbacks_(&callbacks),
          flow_(&flow),
          guards_(std::move(guards)),
          modes_(modes)
    {
    }

    std::string name;

    [[nodiscard]] RunDoor& callbacks() const noexcept { return *callbacks_; }
    [[nodiscard]] std::size_t mode_count() const noexcept { return modes_; }
    [[nodiscard]] std::size_t guard_count() const noexcept { return guards_.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return callbacks_->table().info(callbacks_->door(), which);
    }

    template <class S>
    void flow(Mode mode, const S& t, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        callbacks_->watch().tick();
        flow_->in(mode).evaluate(t, x, dxdt, scratch<S>());
    }
    template <class S>
    [[nodiscard]] S guard(std::size_t which, Mode mode, const S& t, const std::vector<S>& x) const
    {
        callbacks_->watch().tick();
        S value(0.0);
        guards_[which]->in(mode).evaluate(t, x, &value, scratch<S>());
        return value;
    }

private:
    template <class S>
    [[nodiscard]] static std::vector<S>& scratch()
    {
        thread_local std::vector<S> values;
        return values;
    }

    RunDoor* callbacks_;
    const ModedFormula* flow_;
    std::vector<const ModedFormula*> guards_;
    std::size_t modes_;
};

/// @param callbacks  a door to the system, used for resets and all functions other than flow and
/// guards
class FormulaDoor final : public RunDoor {
    using Table = detail::SystemTable<State>;
    using Method = detail::TaylorOf<0>;

public:
    FormulaDoor(std::unique_ptr<RunDoor> callbacks, const ModedFormula& flow,
                std::vector<const ModedFormula*> guards, const State& x0)
        : callbacks_(std::move(callbacks)),
          table_(table_beside(callbacks_->table())),
          system_(*callbacks_, flow, std::move(guards), flow.by_mode.size()),
          door_(system_, x0)
    {
    }

    [[nodiscard]] const Table& table() const noexcept override { return table_; }
    [[nodiscard]] void* door() noexcept override
    {
        return static_cast<detail::Door<FormulaSystem, State>*>(&door_);
    }
    [[nodiscard]] bool is_free() const noexcept override { return callbacks_->is_free(); }
    void step_by_series(detail::RunSetup<State>& setup) override
    {
        detail::step_by_series<FormulaSystem, State, 0>(setup);
    }
    [[nodiscard]] SignalWatch& watch() noexcept override { return callbacks_->watch(); }

private:
    /// Forwards a call to the other door.
    template <auto member>
    struct Forward;
    template <class R, class... A, R (*Table::*member)(void*, A...)>
    struct Forward<member> {
        static R call(void* door, A... arguments)
        {
            RunDoor& to =
                static_cast<detail::Door<FormulaSystem, State>*>(door)->system().callbacks();
            return (to.table().*member)(to.door(), arguments...);
        }
    };
    template <auto member>
    static void forward(Table& table, const Table& from)
    {
        table.*member = from.*member ? &Forward<member>::call : nullptr;
    }

    [[nodiscard]] static Table table_beside(const Table& from)
    {
        Table table = detail::system_table<FormulaSystem, State>;
        table.guarded = from.guarded;
        table.moded = from.moded;
        table.changes_dimension = from.changes_dimension;
        table.bounded = from.bounded;
        forward<&Table::mode_count>(table, from);
        forward<&Table::enabled_in>(table, from);
        forward<&Table::enabled_at>(table, from);
        forward<&Table::reset>(table, from);
        forward<&Table::reset_set>(table, from);
        forward<&Table::rest>(table, from);
        forward<&Table::next_time_event>(table, from);
        forward<&Table::previous_time_event>(table, from);
        forward<&Table::next_time_event_at>(table, from);
        forward<&Table::time_event_count>(table, from);
        forward<&Table::time_reset>(table, from);
        forward<&Table::lipschitz>(table, from);
        forward<&Table::speed_bound>(table, from);
        forward<&Table::acceleration_bound>(table, from);
        forward<&Table::lower_bound>(table, from);
        forward<&Table::upper_bound>(table, from);
        return table;
    }

    std::unique_ptr<RunDoor> callbacks_;
    Table table_;
    FormulaSystem system_;
    detail::StepperDoor<FormulaSystem, State, Method> door_;
};

}  // namespace ricochet::python
