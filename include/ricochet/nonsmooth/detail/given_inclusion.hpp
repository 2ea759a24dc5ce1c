// Internal: the declarations of this header may change without notice.
//
// The inclusion that a hybrid system gives by set_valued() or, one for each mode, set_valued(mode).
#pragma once

#include <concepts>
#include <cstddef>
#include <optional>
#include <type_traits>

#include "ricochet/nonsmooth/detail/inclusion_declarations.hpp"
#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

template <class T>
struct WithoutOptional {
    using type = T;
};
template <class T>
struct WithoutOptional<std::optional<T>> {
    using type = T;
};

template <class System>
concept GivesInclusion = requires(const System& system)
{
    system.set_valued();
};
template <class System>
concept GivesInclusionByMode = requires(const System& system, Mode mode)
{
    system.set_valued(mode);
};

template <class System>
struct GivenInclusion;
template <GivesInclusionByMode System>
struct GivenInclusion<System> {
    using Given = std::remove_cvref_t<decltype(std::declval<const System&>().set_valued(Mode{}))>;
    using type = typename WithoutOptional<Given>::type;
    static constexpr bool by_mode = true;
    static constexpr bool optional = !std::is_same_v<Given, type>;
};
template <class System>
requires(GivesInclusion<System> && !GivesInclusionByMode<System>) struct GivenInclusion<System> {
    using type = std::remove_cvref_t<decltype(std::declval<const System&>().set_valued())>;
    static constexpr bool by_mode = false;
    static constexpr bool optional = false;
};

/// Type of the inclusion.
template <class System>
using InclusionOf = typename GivenInclusion<System>::type;

template <class System>
inline constexpr bool has_inclusion_by_mode = GivenInclusion<System>::by_mode;

/// Calls `take` with the inclusion of every mode, a null pointer where a mode has none; where there
/// is one inclusion for all modes, with it alone.
template <class System, class Take>
void for_each_inclusion(const System& system, std::size_t modes, const Take& take)
{
    if constexpr (!has_inclusion_by_mode<System>) {
        const InclusionOf<System> given = system.set_valued();
        take(&given);
    } else {
        for (std::size_t mode = 0; mode < modes; ++mode) {
            const auto given = system.set_valued(static_cast<Mode>(mode));
            if constexpr (GivenInclusion<System>::optional) {
                take(given ? &*given : nullptr);
            } else {
                take(&given);
            }
        }
    }
}

/// Whether an inclusion has a function of this name. One of final type is not examined.
template <class Name, class Set>
inline constexpr bool declares_function = Name::template named<Set> && !std::is_final_v<Set> &&
                                          !Name::template value<Set> && !Name::template type<Set>;

/// Refuses an inclusion that declares more than motion beside a system: there would be two clocks.
/// Returns true, as `check_declarations`.
template <class Set>
constexpr bool check_motion_alone()
{
#define RICOCHET_CHECK(name)                                                                     \
    static_assert(!declares_function<Name_##name, Set>,                                          \
                  "ricochet: found a member `" #name                                             \
                  "` of what set_valued returns, which nothing calls there; expected it in the " \
                  "system, or static constexpr bool unchecked_names = true in the inclusion");
    if constexpr (!requires { requires Set::unchecked_names; }) {
        RICOCHET_CHECK(guard)
        RICOCHET_CHECK(guards)
        RICOCHET_CHECK(guard_info)
        RICOCHET_CHECK(reset)
        RICOCHET_CHECK(rest)
        RICOCHET_CHECK(enabled)
        RICOCHET_CHECK(next_time_event)
        RICOCHET_CHECK(time_reset)
    }
#undef RICOCHET_CHECK
    return true;
}

// --- start_mode and change ---

template <class System, class X>
concept StartsInMode = requires(const System& system, Mode& mode, const X& x)
{
    mode = system.start_mode(mode, 0.0, x);
};
template <class System, class X>
concept StartsMode = requires(const System& system, Mode& mode, const X& x)
{
    mode = system.start_mode(0.0, x);
};

/// With modes Mode change(reaction, kind, mode, t, x), else void change(reaction, kind, t, x).
template <class System, class X>
concept ChangesMode = requires(const System& system, Mode& mode, X& x)
{
    mode = system.change(std::size_t{}, EventKind::stick, Mode{}, 0.0, x);
};
template <class System, class X>
concept ChangesState = requires(const System& system, X& x)
{
    system.change(std::size_t{}, EventKind::stick, 0.0, x);
};

template <class System>
concept NamesChange = requires
{
    &System::change;
    requires !std::is_member_object_pointer_v<decltype(&System::change)>;
};

template <class System, class X>
constexpr bool check_set_valued()
{
    constexpr bool checks = !requires
    {
        requires System::unchecked_names;
    };
    static_assert(check_motion_alone<InclusionOf<System>>());
    static_assert(!has_inclusion_by_mode<System> || Moded<System, X>,
                  "ricochet: found set_valued(mode) in a system without modes; expected mode_count "
                  "and functions that take a Mode, or set_valued()");
    static_assert(
        !Moded<System, X> || has_inclusion_by_mode<System> || StartsMode<System, X> ||
            StartsInMode<System, X>,
        "ricochet: found a system with modes and set_valued(); expected Mode start_mode(Mode mode, "
        "double t, const State& x) const as well, the mode after it, or set_valued(Mode mode)");
    static_assert(!checks || !NamesChange<System> || ChangesMode<System, X> ||
                      (!Moded<System, X> && ChangesState<System, X>),
                  "ricochet: found a change that does not fit; expected Mode change(std::size_t "
                  "reaction, EventKind kind, Mode mode, double t, State& x) const, or without "
                  "modes void change(std::size_t reaction, EventKind kind, double t, State& x) "
                  "const");
    return true;
}

}  // namespace ricochet::detail
