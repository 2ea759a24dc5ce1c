// Internal: the declarations of this header may change without notice.
//
// Overloads that refuse mistaken calls of `integrate`, each with a sentence in place of the
// compiler's list of candidates.
//
// These overloads are never called. They accept arguments written in braces, which have no
// type, and are worse matches than the right ones wherever those fit.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/options.hpp"
#include "ricochet/run.hpp"

namespace ricochet {

namespace detail {

template <class...>
inline constexpr bool never = false;

/// A system and a start of any type.
struct AnySystemGiven {
    template <class System>
    AnySystemGiven(const System&);
};
struct AnyStartGiven {
    template <class X>
    AnyStartGiven(const X&);
    AnyStartGiven(std::initializer_list<double>);
};

}  // namespace detail

/// A call without options.
template <class Unused = void>
auto integrate(detail::AnySystemGiven, detail::AnyStartGiven)
{
    static_assert(detail::never<Unused>,
                  "ricochet: found no options; expected at least when the run ends, {.t_end = 20}");
    return Run<std::vector<double>>{};
}

/// {10, 0, 1} for two components, or {10}, where the others would silently be zero.
template <class System, std::size_t given, class... Choices>
requires(detail::fixed_size<typename System::State>() > 0 &&
         detail::fixed_size<typename System::State>() != given)  //
    auto integrate(const System&, const double (&)[given], const Options&, const Choices&...)
{
    static_assert(detail::never<System>,
                  "ricochet: found a start with another number of components than System::State");
    return Run<typename System::State>{};
}

/// A start in braces that could be of any type.
template <class System, std::size_t given, class... Choices>
requires(!requires { typename System::State; })  //
    auto integrate(const System&, const double (&)[given], const Options&, const Choices&...)
{
    static_assert(
        detail::never<System>,
        "ricochet: found a start in braces for a system that declares no State; expected "
        "`using State = std::array<double, n>` in the system, or State{...} as the start");
    return Run<std::vector<double>>{};
}

}  // namespace ricochet
