// Internal: the declarations of this header may change without notice.
//
// Data of a run with a user-defined stepper, in addition to the system.
#pragma once

#include <type_traits>

#include "ricochet/detail/door.hpp"
#include "ricochet/integrate/methods.hpp"

namespace ricochet::detail {

/// A door with the data of a user-defined stepper.
template <class System, class X, class Method>
struct StepperDoor : Door<System, X> {
    using Stepper = typename Method::template Stepper<X>;

    StepperDoor(const System& system, const X& like) : Door<System, X>(system, like) {}

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
