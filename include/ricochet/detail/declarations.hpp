// Internal: the declarations of this header may change without notice.
//
// Declarations that exist but do not fit.
//
// Concepts detect what a system can do, and a member that satisfies none of them would be
// silently ignored: a guard that is not const, a reset that returns no mode, a function
// of a system with `guard_count` that does not take the number of a guard. Here every such
// member is examined once per system, templates and overloads too, and is refused with
// a sentence. So is a member that cannot be called at all, because it is private or its own
// requires-clause does not hold, and one whose name is a slip away from a known one. A
// system whose names are all intended declares so:
//
//     static constexpr bool unchecked_names = true
//
// A class that is final cannot be examined for names.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <type_traits>

#include "ricochet/guard.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// Result of examining a function that a system may declare.
enum class Declaration : std::uint8_t {
    absent,
    fits,
    not_const,            ///< fits no call on a const system, perhaps one on another
    does_not_fit,         ///< has other parameters or another result
    mode_before_which,    ///< takes a Mode and then `which`, in this order only
    mode_for_which,       ///< has `guard_count` and modes, and takes a Mode in place of `which`
    which_without_count,  ///< takes `which`, but there is no guard_count
    by_value,             ///< changes a copy
};

// --- arguments to try with ---

/// Converts to any type.
struct Anything {
    template <class T>
    operator T() const;
};

/// Becomes a T and nothing that a T converts to.
template <class T>
struct Only {
    template <class U>
    requires std::same_as<U, T>
    operator U() const;
};

/// Every name that is searched for. A class that has a name itself and also inherits it from
/// here has it twice, and a pointer to it is ambiguous.
struct Names {
    int flow, guard, guards, guard_rate, guard_rates, guard_info, guard_count, reset, rest, enabled;
    int next_time_event, previous_time_event, time_reset, time_events, mode_count, crossing,
        unilateral;
    // The names of inclusions, see inclusion_declarations.hpp.
    int smooth, smooth_jacobian, mass, observe, act, offset, offset_rate, branch_bound,
        static_bound, bound_gradient;
    int confines, affine;
};

template <class System, bool final = std::is_final_v<System>>
struct NamesTwice : System, Names {
};

template <class System>
struct NamesTwice<System, true> : Names {
};

// Tests of one name: whether a class has a member of it, how it can be
// called, whether it has an address, whether it is a number or another value.
#define RICOCHET_NAME(name)                                                                 \
    struct Name_##name {                                                                    \
        template <class System>                                                             \
        static constexpr bool named = std::is_final_v<System> || !requires                  \
        {                                                                                   \
            &NamesTwice<System>::name;                                                      \
        };                                                                                  \
        template <class System, class... Arguments>                                         \
        static constexpr bool takes = requires(System & system, Arguments... arguments)     \
        {                                                                                   \
            system.name(static_cast<Arguments>(arguments)...);                              \
        };                                                                                  \
        template <class System>                                                             \
        static constexpr bool addressable = requires                                        \
        {                                                                                   \
            &System::name;                                                                  \
        };                                                                                  \
        template <class System>                                                             \
        static constexpr bool type = requires                                               \
        {                                                                                   \
            typename System::name;                                                          \
        };                                                                                  \
        template <class System>                                                             \
        static constexpr bool number = requires(const System& system)                       \
        {                                                                                   \
            requires std::is_arithmetic_v<std::remove_cvref_t<decltype(system.name)>>;      \
        };                                                                                  \
        template <class System>                                                             \
        static constexpr bool value = requires(const System& system)                        \
        {                                                                                   \
            requires !std::is_function_v<std::remove_reference_t<decltype((system.name))>>; \
        };                                                                                  \
    };
RICOCHET_NAME(flow)
RICOCHET_NAME(guard)
RICOCHET_NAME(guards)
RICOCHET_NAME(guard_rate)
RICOCHET_NAME(guard_rates)
RICOCHET_NAME(guard_info)
RICOCHET_NAME(guard_count)
RICOCHET_NAME(reset)
RICOCHET_NAME(rest)
RICOCHET_NAME(enabled)
RICOCHET_NAME(next_time_event)
RICOCHET_NAME(previous_time_event)
RICOCHET_NAME(time_reset)
RICOCHET_NAME(time_events)
RICOCHET_NAME(mode_count)
RICOCHET_NAME(crossing)
RICOCHET_NAME(unilateral)
RICOCHET_NAME(smooth)
RICOCHET_NAME(smooth_jacobian)
RICOCHET_NAME(mass)
RICOCHET_NAME(observe)
RICOCHET_NAME(act)
RICOCHET_NAME(offset)
RICOCHET_NAME(offset_rate)
RICOCHET_NAME(branch_bound)
RICOCHET_NAME(static_bound)
RICOCHET_NAME(bound_gradient)
RICOCHET_NAME(confines)
RICOCHET_NAME(affine)
#undef RICOCHET_NAME

/// Callable with these, after up to four and before up to one argument of any type.
template <class Name, class System, class... Middle>
concept CallableAround =
    Name::template takes<System, Middle...> || Name::template takes<System, Anything, Middle...> ||
    Name::template takes<System, Anything, Anything, Middle...> ||
    Name::template takes<System, Anything, Anything, Anything, Middle...> ||
    Name::template takes<System, Anything, Anything, Anything, Anything, Middle...> ||
    Name::template takes<System, Middle..., Anything> ||
    Name::template takes<System, Anything, Middle..., Anything> ||
    Name::template takes<System, Anything, Anything, Middle..., Anything> ||
    Name::template takes<System, Anything, Anything, Anything, Middle..., Anything>;

/// Callable with a time of the scalar type of the state, as templates over that type are.
template <class Name, class System, class... States>
concept CallableWithTime = Name::template takes<System, double, States...> ||
                           Name::template takes<System, Anything, double, States...> ||
                           Name::template takes<System, Anything, Anything, double, States...>;

/// Callable in some way. States are passed as such, and arguments of any type only as a last
/// resort, so that templates of a state are not tried with something that is no state.
template <class Name, class System, class X>
concept CallableSomehow = CallableAround<Name, System, X&, X&> ||
    CallableAround<Name, System, X&> || CallableAround<Name, System> ||
    CallableWithTime<Name, System, X&, X&> || CallableWithTime<Name, System, X&>;

/// The reason why a function fits no form.
template <class Name, class System, class X>
[[nodiscard]] constexpr Declaration unfit() noexcept
{
    if constexpr (!Name::template named<System>) {
        return Declaration::absent;
    } else if constexpr (Name::template number<System>) {
        return Declaration::absent;  // a length that is called `rest`
    } else if constexpr (CallableSomehow<Name, const System, X>) {
        return Declaration::does_not_fit;
    } else if constexpr (CallableSomehow<Name, System, X>) {
        return Declaration::not_const;
    } else {
        return Name::template addressable<System> ? Declaration::does_not_fit : Declaration::absent;
    }
}

/// A member of this name exists, but is not accessible or callable.
template <class Name, class System, class X>
[[nodiscard]] constexpr bool is_hidden() noexcept
{
    if constexpr (std::is_final_v<System> || !Name::template named<System> ||
                  Name::template type<System>) {
        return false;
    } else {
        return !CallableSomehow<Name, System, X> && !Name::template addressable<System> &&
               !Name::template value<System>;
    }
}

/// Takes a Mode, and only a Mode, in place of the number of a guard.
template <class Name, class System, class... Rest>
concept TakesOnlyMode = Name::template takes<const System, Only<Mode>, Rest...> &&
                        !Name::template takes<const System, Only<std::size_t>, Rest...>;

/// Takes the number of a guard, and only that, in place of a Mode.
template <class Name, class System, class... Rest>
concept TakesOnlyWhich = !Name::template takes<const System, Only<Mode>, Rest...> &&
                         Name::template takes<const System, Only<std::size_t>, Rest...>;

/// Takes a Mode and then the number of a guard, and not in the right order.
template <class Name, class System, class... Rest>
concept TakesModeBeforeWhich =
    CountsGuards<System> &&
    !Name::template takes<const System, Only<std::size_t>, Only<Mode>, Rest...> &&
    Name::template takes<const System, Only<Mode>, Only<std::size_t>, Rest...>;

/// Whether a function that has a form takes a state of this type, which may be a copy.
template <class Name, Form form, class System, class State, class... Middle>
[[nodiscard]] constexpr bool takes_state() noexcept
{
    if constexpr (form == Form::of_guard_in_mode) {
        return Name::template takes<const System, std::size_t, Middle..., Mode, double, State>;
    } else if constexpr (form == Form::of_guard) {
        return Name::template takes<const System, std::size_t, Middle..., double, State>;
    } else if constexpr (form == Form::in_mode) {
        return Name::template takes<const System, Middle..., Mode, double, State>;
    } else {
        return form == Form::plain && Name::template takes<const System, Middle..., double, State>;
    }
}

/// A mode and the number of a guard convert into each other, so either can be taken for the
/// other. `counted` and `moded` state the form in which the function is used.
template <class Name, class System, class X, bool counted, bool moded, class... Rest>
[[nodiscard]] constexpr Declaration told_apart() noexcept
{
    if constexpr (TakesModeBeforeWhich<Name, System, Rest...>) {
        return Declaration::mode_before_which;
    } else if constexpr (counted) {
        if constexpr (Moded<System, X> && TakesOnlyMode<Name, System, Rest...>) {
            return Declaration::mode_for_which;
        }
    } else if constexpr (moded) {
        if constexpr (!Moded<System, X> && TakesOnlyWhich<Name, System, Rest...>) {
            return Declaration::which_without_count;
        }
    }
    return Declaration::fits;
}

// --- one function after the other ---

template <class System, class X>
[[nodiscard]] constexpr Declaration flow_declaration() noexcept
{
    if constexpr (!Flowing<System, X>) {
        return unfit<Name_flow, System, X>();
    } else if constexpr (Name_flow::addressable<System> &&
                         (Name_flow::takes<const System, double, const X&, X> ||
                          Name_flow::takes<const System, Mode, double, const X&, X>)) {
        return Declaration::by_value;
    } else {
        return Declaration::fits;
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration guard_declaration() noexcept
{
    if constexpr (!GuardAlone<System, X>) {
        return unfit<Name_guard, System, X>();
    } else {
        return told_apart < Name_guard, System, X,
               guard_form<System, X> == Form::of_guard, guard_form<System, X> == Form::in_mode,
               double, const X& > ();
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration guards_declaration() noexcept
{
    if constexpr (GuardsTogether<System, X>) {
        return Declaration::fits;
    } else {
        return unfit<Name_guards, System, X>();
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration guard_rate_declaration() noexcept
{
    if constexpr (!RateAlone<System, X>) {
        return unfit<Name_guard_rate, System, X>();
    } else {
        return told_apart < Name_guard_rate, System, X,
               rate_form<System, X> == Form::of_guard,
               rate_form<System, X> == Form::in_mode, double, const X&, const X& > ();
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration guard_rates_declaration() noexcept
{
    if constexpr (RatesTogether<System, X>) {
        return Declaration::fits;
    } else {
        return unfit<Name_guard_rates, System, X>();
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration guard_info_declaration() noexcept
{
    if constexpr (InfoOf<System> || SingleInfo<System>) {
        return Declaration::fits;
    } else {
        return unfit<Name_guard_info, System, X>();
    }
}

/// A declaration that is refused. Functions that need it do not fit then, and are not reported.
template <class Name, class System, class X>
[[nodiscard]] constexpr bool is_refused(Declaration found) noexcept
{
    return (found != Declaration::absent && found != Declaration::fits) ||
           is_hidden<Name, System, X>();
}

template <class System, class X>
[[nodiscard]] constexpr bool refuses_guards() noexcept
{
    return is_refused<Name_guard, System, X>(guard_declaration<System, X>()) ||
           is_refused<Name_guards, System, X>(guards_declaration<System, X>());
}

template <class System, class X>
[[nodiscard]] constexpr Declaration reset_declaration() noexcept
{
    if constexpr (refuses_guards<System, X>()) {
        return Declaration::absent;
    } else if constexpr (!Resetting<System, X>) {
        return unfit<Name_reset, System, X>();
    } else if constexpr (DirectedReset<System, X>) {
        return takes_state<Name_reset, directed_reset_form<System, X>, System, X, Crossing>()
                   ? Declaration::by_value
                   : Declaration::fits;
    } else if constexpr (takes_state<Name_reset, reset_form<System, X>, System, X>() ||
                         takes_state<Name_reset, set_reset_form<System, X>, System, X,
                                     const FiredGuards&>()) {
        return Declaration::by_value;
    } else if constexpr (ResetsTogether<System, X>) {
        return Declaration::fits;
    } else {
        return told_apart < Name_reset, System, X,
               reset_form<System, X> == Form::of_guard, reset_form<System, X> == Form::in_mode,
               double, X& > ();
    }
}

/// Without reset the function would never be called, and does not fit.
template <class System, class X>
[[nodiscard]] constexpr Declaration rest_declaration() noexcept
{
    if constexpr (refuses_guards<System, X>() ||
                  is_refused<Name_reset, System, X>(reset_declaration<System, X>())) {
        return Declaration::absent;
    } else if constexpr (!Resting<System, X>) {
        return unfit<Name_rest, System, X>();
    } else if constexpr (takes_state<Name_rest, rest_form<System, X>, System, X>()) {
        return Declaration::by_value;
    } else if constexpr (!Resetting<System, X>) {
        return Declaration::does_not_fit;
    } else {
        return told_apart < Name_rest, System, X, rest_form<System, X> == Form::of_guard,
               rest_form<System, X> == Form::in_mode, double, X& > ();
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration enabled_declaration() noexcept
{
    if constexpr (!Guarded<System, X>) {
        return Declaration::absent;  // there are no guards
    } else if constexpr (!EnabledIn<System> && !EnabledAt<System, X>) {
        if constexpr (Name_enabled::number<System>) return Declaration::does_not_fit;
        return unfit<Name_enabled, System, X>();
    } else if constexpr (EnabledIn<System> && TakesModeBeforeWhich<Name_enabled, System>) {
        return Declaration::mode_before_which;
    } else if constexpr (CountsGuards<System> && EnabledAt<System, X>) {
        return told_apart<Name_enabled, System, X, enabled_form<System, X> == Form::of_guard, false,
                          double, const X&>();
    } else {
        return Declaration::fits;
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration next_time_event_declaration() noexcept
{
    if constexpr (TimedByFunction<System> || TimedByState<System, X>) {
        return Declaration::fits;
    } else {
        return unfit<Name_next_time_event, System, X>();
    }
}

/// A value, or a function without parameters; a function of the same name with parameters
/// has another purpose.
template <class Name, class System, bool fits>
[[nodiscard]] constexpr Declaration value_declaration() noexcept
{
    if constexpr (fits) {
        return Declaration::fits;
    } else if constexpr (!Name::template named<System>) {
        return Declaration::absent;
    } else if constexpr (Name::template takes<const System> || Name::template value<System>) {
        return Declaration::does_not_fit;
    } else {
        return Name::template takes<System> ? Declaration::not_const : Declaration::absent;
    }
}

/// A value of the name that is no `Times` is refused where nothing else says when events happen.
template <class System, class X>
[[nodiscard]] constexpr Declaration time_events_declaration() noexcept
{
    if constexpr (ListsTimes<System>) {
        return Declaration::fits;
    } else if constexpr (TimedByFunction<System> || TimedByState<System, X> ||
                         Name_time_events::number<System>) {
        return Declaration::absent;
    } else {
        return value_declaration<Name_time_events, System, false>();
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration previous_time_event_declaration() noexcept
{
    if constexpr (TimedBackward<System>) {
        return Declaration::fits;
    } else {
        return unfit<Name_previous_time_event, System, X>();
    }
}

/// Without next_time_event the function would never be called, and does not fit.
template <class System, class X>
[[nodiscard]] constexpr Declaration time_reset_declaration() noexcept
{
    if constexpr (is_refused<Name_next_time_event, System, X>(
                      next_time_event_declaration<System, X>())) {
        return Declaration::absent;
    } else if constexpr (!TimeResetting<System, X>) {
        return unfit<Name_time_reset, System, X>();
    } else if constexpr (!Timed<System> && !TimedByState<System, X>) {
        return Declaration::does_not_fit;
    } else if constexpr (Name_time_reset::takes<const System, double, X> ||
                         Name_time_reset::takes<const System, Mode, double, X>) {
        return Declaration::by_value;
    } else {
        return Declaration::fits;
    }
}

template <class System, class X>
[[nodiscard]] constexpr Declaration guard_count_declaration() noexcept
{
    return value_declaration<Name_guard_count, System, CountsGuards<System>>();
}

template <class System, class X>
[[nodiscard]] constexpr Declaration mode_count_declaration() noexcept
{
    constexpr bool fits = requires(const System& system)
    {
        {
            system.mode_count
            } -> std::convertible_to<std::size_t>;
    }
    || requires(const System& system)
    {
        {
            system.mode_count()
            } -> std::convertible_to<std::size_t>;
    };
    return value_declaration<Name_mode_count, System, fits>();
}

template <class System, class X>
[[nodiscard]] constexpr Declaration crossing_declaration() noexcept
{
    constexpr bool fits = requires(const System& system)
    {
        {
            system.crossing
            } -> std::convertible_to<Crossing>;
    };
    return value_declaration<Name_crossing, System, fits>();
}

/// A function is excluded, since its address would convert to true.
template <class System, class X>
[[nodiscard]] constexpr Declaration unilateral_declaration() noexcept
{
    constexpr bool fits = requires(const System& system)
    {
        {
            system.unilateral
            } -> std::convertible_to<bool>;
        requires !std::is_function_v<std::remove_reference_t<decltype((system.unilateral))>>;
    };
    return value_declaration<Name_unilateral, System, fits>();
}

/// Whether the system says that its events change nothing: they are recorded, or end the run. A
/// class inside a function, which has no static data, says so by a function.
template <class System>
[[nodiscard]] consteval bool says_no_reset() noexcept
{
    if constexpr (requires {
                      {
                          &System::resets
                          } -> std::same_as<const bool*>;
                  }) {
        return !System::resets;
    } else if constexpr (requires {
                             {
                                 &System::resets
                                 } -> std::convertible_to<bool (*)()>;
                         }) {
        return !System::resets();
    } else {
        return false;
    }
}

/// Rejects a system with set_valued() where its inclusion would be ignored.
template <class System>
constexpr bool has_flow_alone()
{
    static_assert(
        !requires(const System& system) { system.set_valued(); } &&
            !requires(const System& system) { system.set_valued(Mode{}); },
        "ricochet: found a system with set_valued(); expected the target to link "
        "ricochet::nonsmooth, ricochet/nonsmooth/hand_over.hpp to be included, and a "
        "call of integrate or Simulation, which alone follow an inclusion");
    return true;
}

/// Refuses what does not fit. Returns true, so that a static_assert evaluates this check first.
// Long: a list of members with a sentence for each, whose macro reads names of this function.
template <class System, class X>
constexpr bool check_declarations()
{
    constexpr bool checks_names = !requires
    {
        requires System::unchecked_names;
    };
#define RICOCHET_CHECK(name, expected)                                                        \
    {                                                                                         \
        constexpr Declaration found = name##_declaration<System, X>();                        \
        static_assert(!checks_names || !is_hidden<Name_##name, System, X>(),                  \
                      "ricochet: found a " #name                                              \
                      " that cannot be used: it is private, or its "                          \
                      "requires-clause does not hold; expected " expected                     \
                      "; or declare "                                                         \
                      "static constexpr bool unchecked_names = true if that is meant");       \
        static_assert(found != Declaration::not_const,                                        \
                      "ricochet: found a " #name " that is not const; expected " expected);   \
        static_assert(found != Declaration::does_not_fit,                                     \
                      "ricochet: found a " #name                                              \
                      " whose parameters or result do not fit; "                              \
                      "expected " expected);                                                  \
        static_assert(found != Declaration::mode_before_which,                                \
                      "ricochet: found a " #name                                              \
                      " that takes the Mode before the number of "                            \
                      "the guard; expected " expected);                                       \
        static_assert(                                                                        \
            found != Declaration::mode_for_which,                                             \
            "ricochet: found a " #name                                                        \
            " that takes a Mode where the number of the "                                     \
            "guard belongs, in a system with modes and guard_count; expected " expected);     \
        static_assert(found != Declaration::which_without_count,                              \
                      "ricochet: found a " #name                                              \
                      " that takes std::size_t first, in a "                                  \
                      "system without guard_count; expected guard_count, or " expected);      \
        static_assert(found != Declaration::by_value,                                         \
                      "ricochet: found a " #name " that changes a copy; expected " expected); \
    }
    RICOCHET_CHECK(
        guard_count,
        "a number of guards: guard_count, or guard_count() const, convertible to std::size_t")
    RICOCHET_CHECK(
        mode_count,
        "a number of modes: mode_count, or mode_count() const, convertible to std::size_t")
    RICOCHET_CHECK(crossing, "a data member of type ricochet::Crossing")
    RICOCHET_CHECK(unilateral, "a data member of type bool")
    RICOCHET_CHECK(flow, "void flow([Mode,] double t, const State& x, State& dxdt) const")
    RICOCHET_CHECK(
        guard,
        "double guard([std::size_t which,] [Mode,] double t, const State& x) const, "
        "with `which` if and only if there is a guard_count; modes are a Mode, not an enum")
    RICOCHET_CHECK(guards,
                   "void guards([Mode,] double t, const State& x, std::span<double> g) const, with "
                   "a guard_count")
    RICOCHET_CHECK(
        guard_rate,
        "double guard_rate([std::size_t which,] [Mode,] double t, const State& x, const State& "
        "dxdt) const, "
        "with `which` if and only if there is a guard_count; modes are a Mode, not an enum")
    RICOCHET_CHECK(guard_rates,
                   "void guard_rates([Mode,] double t, const State& x, const State& dxdt, "
                   "std::span<double> rates) const, with a guard_count")
    RICOCHET_CHECK(guard_info,
                   "GuardInfo guard_info(std::size_t which) const, or without `which` where there "
                   "is no guard_count")
    RICOCHET_CHECK(reset,
                   "void reset([std::size_t which,] double t, State& x) const, or Mode "
                   "reset([std::size_t which,] Mode, double t, State& x) const, "
                   "or with const FiredGuards& for `which`; `which` if and only if there is a "
                   "guard_count; and a guard; the direction of the crossing may follow `which`")
    RICOCHET_CHECK(rest,
                   "void rest([std::size_t which,] double t, State& x) const, or Mode "
                   "rest([std::size_t which,] Mode, double t, State& x) const, "
                   "with `which` if and only if there is a guard_count; and a guard and a reset")
    RICOCHET_CHECK(enabled,
                   "bool enabled([std::size_t which,] Mode) const, or bool enabled([std::size_t "
                   "which,] [Mode,] double t, const State& x) const, "
                   "with `which` if and only if there is a guard_count")
    RICOCHET_CHECK(next_time_event,
                   "double next_time_event(double t) const, or double next_time_event([Mode,] "
                   "double t, const State& x) const")
    RICOCHET_CHECK(time_events,
                   "ricochet::Times time_events, or const ricochet::Times& time_events() const")
    RICOCHET_CHECK(previous_time_event, "double previous_time_event(double t) const")
    RICOCHET_CHECK(time_reset,
                   "void time_reset(double t, State& x) const, or Mode time_reset(Mode, double t, "
                   "State& x) const, with a next_time_event or Times time_events")
#undef RICOCHET_CHECK
    constexpr bool has_reset = reset_declaration<System, X>() != Declaration::absent ||
                               is_hidden<Name_reset, System, X>() || refuses_guards<System, X>();
    static_assert(!checks_names || !Guarded<System, X> || has_reset || says_no_reset<System>(),
                  "ricochet: found a guard and no reset; expected a reset of that name or, where "
                  "events are only recorded or end the run, static constexpr bool resets = false");
    if constexpr (CountsGuards<System>) {
        static_assert(Guarded<System, X>,
                      "ricochet: found guard_count, but neither guard(which, [mode,] t, x) nor "
                      "guards([mode,] t, x, g) that fits the state");
    }
    return true;
}

// --- systems and starts ---

/// Stands for the state of a system that declares none, where a start is given in braces.
struct UndeclaredState {
    UndeclaredState(std::initializer_list<double>);
};

template <class System>
struct DeclaredStateOf {
    using type = UndeclaredState;
};
template <class System>
requires requires
{
    typename System::State;
}
struct DeclaredStateOf<System> {
    using type = typename System::State;
};

/// The state that a system declares, which a start in braces has.
template <class System>
using DeclaredState = typename DeclaredStateOf<System>::type;

/// Whether the flow fits the state type that the system declares, but not the type of the start.
template <class System, class X>
[[nodiscard]] consteval bool takes_another_state()
{
    if constexpr (requires { typename System::State; }) {
        return !std::is_same_v<X, typename System::State> &&
               Flowing<System, typename System::State>;
    } else {
        return false;
    }
}

/// Refuses a system that cannot be run, or a start that is none, with one sentence. Returns true.
template <class System, class X>
constexpr bool check_system()
{
    if constexpr (std::is_same_v<X, UndeclaredState>) {
        static_assert(
            !std::is_same_v<X, UndeclaredState>,
            "ricochet: found a start in braces for a system that declares no State; expected "
            "`using State = std::array<double, n>` in the system, or State{...} as the start");
    } else if constexpr (!StateVector<X>) {
        static_assert(
            StateVector<X>,
            "ricochet: found a start that is no state; expected std::array, std::vector or a "
            "vector of Eigen, of double");
    } else if constexpr (!Flowing<System, X> && takes_another_state<System, X>()) {
        static_assert(Flowing<System, X>,
                      "ricochet: found a start of another type than System::State, which is what "
                      "the flow takes");
    } else {
        static_assert(check_declarations<System, X>());
        static_assert(flow_declaration<System, X>() != Declaration::absent,
                      "ricochet: found no flow that fits the state; expected void flow([Mode,] "
                      "double t, const State& x, State& dxdt) const");
    }
    return true;
}

}  // namespace ricochet::detail
