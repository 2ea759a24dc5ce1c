// A step of a method on a system, in the form that the loop uses.
#pragma once

#include <limits>

#include "core/step.hpp"
#include "ricochet/detail/door.hpp"
#include "ricochet/detail/kernels.hpp"

namespace ricochet::test {

template <class Method, class System, class X>
struct DoorOf {
    detail::StepperDoor<System, X, Method> door;
};

/// Its states are those of the loop.
template <class Method, class System, class X>
class StepOf : DoorOf<Method, System, X>, public detail::Step<detail::CoreState<X>> {
    using Step = detail::Step<detail::CoreState<X>>;
    using At = DoorOf<Method, System, X>;
    static constexpr double infinity = std::numeric_limits<double>::infinity();

public:
    StepOf(const System& system, double t, const X& x, Mode mode = 0, bool backward = false)
        : At{{system, x}},
          Step({detail::system_table<System, X>,
                static_cast<detail::Door<System, X>*>(&this->At::door)},
               detail::kernel_for<System, X>(Method{}), detail::core_state(x),
               {.t_start = t, .t_end = backward ? -infinity : infinity, .mode = mode})
    {
    }
};

}  // namespace ricochet::test
