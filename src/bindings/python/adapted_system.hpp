// A system of Python in place of a user's type, for templates over a system type.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "source.hpp"

namespace ricochet::python {

/// Holds the interpreter lock, for systems that need it.
class Interpreter {
public:
    explicit Interpreter(bool needed) : needed_(needed)
    {
        if (needed_) state_ = PyGILState_Ensure();
    }
    Interpreter(const Interpreter&) = delete;
    Interpreter& operator=(const Interpreter&) = delete;
    ~Interpreter()
    {
        if (needed_) PyGILState_Release(state_);
    }

private:
    bool needed_;
    PyGILState_STATE state_{};
};

/// A system at a adapter of its own, whose functions may be called without the interpreter.
///
/// Absent functions have neutral defaults: resets that change nothing, time events that never
/// come. `guard_info` tells whether a guard has a reset.
class AdaptedSystem {
public:
    static constexpr bool unchecked_names = true;
    using State = python::State;

    AdaptedSystem(const Source& source, const State& like)
        : source_(&source), adapter_(source.open(like)), table_(&adapter_->table())
    {
        if (adapter_->has_inclusion() || adapter_->has_contacts()) {
            throw std::invalid_argument(
                "set_valued: found set-valued motion, expected none: a network cannot learn from "
                "it");
        }
        if (table_->next_time_event_at) {
            throw std::invalid_argument(
                "next_time_event: found one that takes the state, expected next_time_event(t) or "
                "time_events, whose runs a network can learn from");
        }
        name = table_->name(adapter_->adapter());
    }

    std::string name;

    [[nodiscard]] bool is_bounded() const noexcept { return table_->bounded; }
    [[nodiscard]] std::size_t mode_count() const
    {
        return std::max<std::size_t>(table_->mode_count(at()), 1);
    }
    [[nodiscard]] std::size_t guard_count() const
    {
        return table_->guarded ? table_->guard_count(at()) : 0;
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return table_->info(at(), which);
    }
    [[nodiscard]] std::optional<double> parameter(std::string_view of) const
    {
        const auto found = source_->parameters.find(of);
        if (found == source_->parameters.end()) return std::nullopt;
        return found->second;
    }

    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        const Interpreter held(needs_interpreter());
        (void)table_->flow(at(), mode, t, x, dxdt);
    }
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x) const
    {
        const Interpreter held(needs_interpreter());
        return table_->guard(at(), which, mode, t, x);
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        const Interpreter held(needs_interpreter());
        return !table_->enabled_in || table_->enabled_in(at(), which, mode);
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode, double t, const State& x) const
    {
        const Interpreter held(needs_interpreter());
        return !table_->enabled_at || table_->enabled_at(at(), which, mode, t, x);
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, State& x) const
    {
        const Interpreter held(needs_interpreter());
        if (table_->reset_set) {
            const std::array<std::size_t, 1> fired{which};
            return table_->reset_set(at(), FiredGuards(fired), mode, t, x);
        }
        return table_->reset ? table_->reset(at(), which, mode, t, x) : mode;
    }
    [[nodiscard]] Mode rest(std::size_t which, Mode mode, double t, State& x) const
    {
        const Interpreter held(needs_interpreter());
        return table_->rest ? table_->rest(at(), which, mode, t, x) : mode;
    }

    [[nodiscard]] double next_time_event(double t) const
    {
        const Interpreter held(needs_interpreter());
        return table_->next_time_event ? table_->next_time_event(at(), t)
                                       : std::numeric_limits<double>::infinity();
    }
    [[nodiscard]] Mode time_reset(Mode mode, double t, State& x) const
    {
        const Interpreter held(needs_interpreter());
        return table_->time_reset ? table_->time_reset(at(), mode, t, x) : mode;
    }

    [[nodiscard]] double lipschitz(std::size_t which) const
    {
        return table_->lipschitz(at(), which);
    }
    [[nodiscard]] double speed_bound(std::size_t which, Mode mode, double t, const State& x) const
    {
        return bound(table_->speed_bound, which, mode, t, x);
    }
    [[nodiscard]] double acceleration_bound(std::size_t which, Mode mode, double t,
                                            const State& x) const
    {
        return bound(table_->acceleration_bound, which, mode, t, x);
    }

private:
    using Bound = double (*)(void*, std::size_t, Mode, double, const State&);

    [[nodiscard]] void* at() const noexcept { return adapter_->adapter(); }
    [[nodiscard]] bool needs_interpreter() const noexcept { return !adapter_->is_free(); }
    [[nodiscard]] double bound(Bound function, std::size_t which, Mode mode, double t,
                               const State& x) const
    {
        const Interpreter held(needs_interpreter());
        return function(at(), which, mode, t, x);
    }

    const Source* source_;
    std::unique_ptr<RunAdapter> adapter_;
    const detail::SystemTable<State>* table_;
};

/// A `AdaptedSystem` with one guard, for templates that require a single guard at compile time.
class SingleGuardSystem {
public:
    static constexpr bool unchecked_names = true;
    using State = python::State;

    explicit SingleGuardSystem(const AdaptedSystem& system) : name(system.name), system_(&system) {}

    std::string name;

    [[nodiscard]] std::size_t mode_count() const { return system_->mode_count(); }
    [[nodiscard]] GuardInfo guard_info() const { return system_->guard_info(0); }
    [[nodiscard]] std::optional<double> parameter(std::string_view of) const
    {
        return system_->parameter(of);
    }
    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        system_->flow(mode, t, x, dxdt);
    }
    [[nodiscard]] double guard(Mode mode, double t, const State& x) const
    {
        return system_->guard(0, mode, t, x);
    }
    [[nodiscard]] bool enabled(Mode mode) const { return system_->enabled(0, mode); }
    [[nodiscard]] bool enabled(Mode mode, double t, const State& x) const
    {
        return system_->enabled(0, mode, t, x);
    }
    [[nodiscard]] Mode reset(Mode mode, double t, State& x) const
    {
        return system_->reset(0, mode, t, x);
    }
    [[nodiscard]] Mode rest(Mode mode, double t, State& x) const
    {
        return system_->rest(0, mode, t, x);
    }
    [[nodiscard]] double next_time_event(double t) const { return system_->next_time_event(t); }
    [[nodiscard]] Mode time_reset(Mode mode, double t, State& x) const
    {
        return system_->time_reset(mode, t, x);
    }

private:
    const AdaptedSystem* system_;
};

}  // namespace ricochet::python
