// A step of a method on a system, in the form that the loop uses.
#pragma once

#include <limits>

#include "core/step.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/detail/system_adapter.hpp"

namespace ricochet::test {

template <class Method, class System, class X>
struct AdapterOf {
    detail::StepperAdapter<System, X, Method> adapter;
};

/// Its states are those of the loop.
template <class Method, class System, class X>
class StepOf : AdapterOf<Method, System, X>, public detail::Step<detail::CoreState<X>> {
    using Step = detail::Step<detail::CoreState<X>>;
    using At = AdapterOf<Method, System, X>;
    static constexpr double infinity = std::numeric_limits<double>::infinity();

public:
    StepOf(const System& system, double t, const X& x, Mode mode = 0, bool backward = false)
        : At{{system, x}},
          Step({detail::system_table<System, X>,
                static_cast<detail::SystemAdapter<System, X>*>(&this->At::adapter)},
               detail::kernel_for<System, X>(Method{}), detail::core_state(x),
               {.t_start = t, .t_end = backward ? -infinity : infinity, .mode = mode})
    {
    }
};

}  // namespace ricochet::test
