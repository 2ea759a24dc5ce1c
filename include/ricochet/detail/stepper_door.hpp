// Internal: the declarations of this header may change without notice.
//
// Data of a run with a user-defined stepper, in addition to the system.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/door.hpp"
#include "ricochet/integrate/methods.hpp"

namespace ricochet::detail {

/// @throws std::invalid_argument: a stepper would compute states of `made` components.
[[noreturn]] inline void throw_state_not_resizable(std::size_t components, std::size_t made)
{
    throw std::invalid_argument(
        "integrate: a user-defined stepper makes states by default and resizes them; found a state "
        "without resize(), of " +
        std::to_string(components) + " components, and " + std::to_string(made) + " by default");
}

/// A door with the data of a user-defined stepper.
template <class System, class X, class Method>
struct StepperDoor : Door<System, X> {
    using Stepper = typename Method::template Stepper<X>;

    /// @throws std::invalid_argument if states can be neither made nor resized to the size of
    /// `like`
    StepperDoor(const System& system, const X& like) : Door<System, X>(system, like)
    {
        if constexpr (fixed_size<X>() == 0 && !requires(X & x) { x.resize(0); }) {
            const auto made = static_cast<std::size_t>(X{}.size());
            const auto components = static_cast<std::size_t>(like.size());
            if (made != components) throw_state_not_resizable(components, made);
        }
    }

    Stepper advancing{};
    Stepper probing{};
};
template <class System, class X, class Method>
requires(NameOf<Method>::known ||
         std::is_same_v<Method, MethodByName>) struct StepperDoor<System, X, Method>
    : Door<System, X> {
    using Door<System, X>::Door;
};

}  // namespace ricochet::detail
