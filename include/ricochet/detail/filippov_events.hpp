// Internal: the declarations of this header may change without notice.
//
// The guards, resets and time events that fields declare beside their switching surfaces, in the
// forms of a system without modes. Fields are such a system but for its flow, which this header
// adds, so that the concepts and calls of system.hpp serve for both.
#pragma once

#include <concepts>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "ricochet/detail/counts.hpp"
#include "ricochet/detail/declarations.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// Fields as a system without modes. Its flow, one of the fields, only makes it one.
template <class Fields>
struct OwnEvents : Fields {
    static_assert(!std::is_final_v<Fields>,
                  "ricochet: found fields whose class is final, so that a guard of theirs could "
                  "not be found; expected a class that is not final");

    explicit OwnEvents(Fields fields) : Fields(std::move(fields)) {}

    template <StateVector X>
    void flow(double t, const X& x, X& dxdt) const
    {
        this->field(0, t, x, dxdt);
    }
};

/// At least one function takes a mode.
template <class Own, class X>
concept TakesModes = Moded<Own, X> || takes_mode(guard_form<Own, X>) ||
    takes_mode(guards_form<Own, X>) || takes_mode(rate_form<Own, X>) ||
    takes_mode(rates_form<Own, X>) || takes_mode(set_reset_form<Own, X>) ||
    takes_mode(reset_form<Own, X>) || takes_mode(directed_reset_form<Own, X>) ||
    takes_mode(rest_form<Own, X>) || EnabledIn<Own> || takes_mode(enabled_form<Own, X>) ||
    takes_mode(timer_form<Own, X>) || takes_mode(time_reset_form<Own, X>);

template <class Fields>
concept DeclaresState = requires
{
    typename Fields::State;
};

/// The number of guards that the fields declare, or `counted_at_run_time`.
template <class Fields>
[[nodiscard]] consteval std::size_t own_guard_count()
{
    using Own = OwnEvents<Fields>;
    if constexpr (DeclaresState<Fields>) {
        return fixed_guard_count<Own, typename Fields::State>();
    } else {
        static_assert(!Name_guard::named<Fields> && !Name_guards::named<Fields>,
                      "ricochet: found fields with guards of their own, but without a type State; "
                      "expected `using State = ...` in the fields");
        return 0;
    }
}

/// The number of guards of the fields together with the `surface_guards` before them.
template <class Fields>
[[nodiscard]] consteval std::size_t guard_count_with(std::size_t surface_guards)
{
    constexpr std::size_t own = own_guard_count<Fields>();
    return own == counted_at_run_time ? counted_at_run_time : surface_guards + own;
}

/// Whether the fields continue accumulations of their events.
template <class Fields>
[[nodiscard]] consteval bool own_guards_rest()
{
    if constexpr (own_guard_count<Fields>() == 0) {
        return false;
    } else {
        return Resting<OwnEvents<Fields>, typename Fields::State>;
    }
}

/// The number of guards of the fields.
template <class Fields>
[[nodiscard]] std::size_t own_guards(const Fields& fields)
{
    constexpr std::size_t fixed = own_guard_count<Fields>();
    if constexpr (fixed == counted_at_run_time) {
        return guard_count_of<typename Fields::State>(fields);
    } else {
        return fixed;
    }
}

/// Refuses what fields declare and nothing would call. True, for static_assert.
template <class Fields, class X>
constexpr bool check_fields()
{
    using Own = OwnEvents<Fields>;
    static_assert(check_declarations<Own, X>());
    static_assert(!Name_flow::named<Fields>,
                  "ricochet: found fields with a flow, which Filippov does not call; expected "
                  "void field(std::size_t region, double t, const State& x, State& dxdt) const");
    static_assert(!TakesModes<Own, X>,
                  "ricochet: found fields with modes of their own; expected guards, resets and "
                  "time events that take no Mode, since the modes of Filippov are the places "
                  "beside its surfaces, or one Filippov for each mode");
    static_assert(
        !requires(const Fields& fields) { fields.set_valued(); },
        "ricochet: found fields with set_valued(), which Filippov does not follow; expected "
        "switching surfaces or an inclusion, not both");
    return true;
}

/// Properties of a guard of the fields. A guard without a reset is only recorded.
template <class Fields>
[[nodiscard]] GuardInfo own_guard_info(const OwnEvents<Fields>& own, std::size_t which)
{
    GuardInfo info;
    if constexpr (own_guard_count<Fields>() > 0) {
        using X = typename Fields::State;
        info = guard_info_of<X>(own, which);
        if (!Resetting<OwnEvents<Fields>, X>) info.resets = false;
    }
    return info;
}

}  // namespace ricochet::detail
