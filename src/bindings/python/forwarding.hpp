// A table of functions that passes every call on to another adapter.
#pragma once

#include "ricochet/detail/system_adapter.hpp"
#include "ricochet/detail/system_table.hpp"
#include "source.hpp"

namespace ricochet::python {

/// Tables of adapters to `System`, which knows the adapter that it stands before as `callbacks()`.
template <class System>
class Forwarding {
    using Table = detail::SystemTable<State>;

    template <auto member>
    struct Function;
    template <class R, class... A, R (*Table::*member)(void*, A...)>
    struct Function<member> {
        static R call(void* adapter, A... arguments)
        {
            RunAdapter& to =
                static_cast<detail::SystemAdapter<System, State>*>(adapter)->system().callbacks();
            return (to.table().*member)(to.adapter(), arguments...);
        }
    };

public:
    /// Forwards one function, if there is one.
    template <auto member>
    static void one(Table& table, const Table& from)
    {
        table.*member = from.*member ? &Function<member>::call : nullptr;
    }

    /// Forwards everything that a system has beside its flow and the values of its guards.
    static void all_but_flow_and_guards(Table& table, const Table& from)
    {
        table.guarded = from.guarded;
        table.moded = from.moded;
        table.changes_dimension = from.changes_dimension;
        table.bounded = from.bounded;
        one<&Table::mode_count>(table, from);
        one<&Table::enabled_in>(table, from);
        one<&Table::enabled_at>(table, from);
        one<&Table::tell_direction>(table, from);
        one<&Table::reset>(table, from);
        one<&Table::reset_set>(table, from);
        one<&Table::rest>(table, from);
        one<&Table::next_time_event>(table, from);
        one<&Table::previous_time_event>(table, from);
        one<&Table::next_time_event_at>(table, from);
        one<&Table::time_event_count>(table, from);
        one<&Table::time_reset>(table, from);
        one<&Table::lipschitz>(table, from);
        one<&Table::speed_bound>(table, from);
        one<&Table::acceleration_bound>(table, from);
        one<&Table::lower_bound>(table, from);
        one<&Table::upper_bound>(table, from);
    }

    /// Forwards all functions.
    static void all(Table& table, const Table& from)
    {
        all_but_flow_and_guards(table, from);
        table.fixed_dimension = from.fixed_dimension;
        table.forward_only = from.forward_only;
        table.rated = from.rated;
        table.guard_alone = from.guard_alone;
        table.calls_of_rate = from.calls_of_rate;
        one<&Table::flow>(table, from);
        one<&Table::guard_count>(table, from);
        one<&Table::name>(table, from);
        one<&Table::info>(table, from);
        one<&Table::guards>(table, from);
        one<&Table::guard>(table, from);
        one<&Table::guard_on>(table, from);
        one<&Table::rate>(table, from);
        one<&Table::rate_on>(table, from);
        one<&Table::point>(table, from);
        one<&Table::rates>(table, from);
        one<&Table::each_rate>(table, from);
        one<&Table::after_set>(table, from);
        one<&Table::rests>(table, from);
    }
};

}  // namespace ricochet::python
