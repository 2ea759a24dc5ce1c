// Determines which systems the stepper taylor accepts.
#pragma once

#include "ricochet/detail/components.hpp"
#include "ricochet/taylor/detail/taylor_adapter.hpp"

namespace ricochet::app {

/// Whether the flow of a system can be a power series.
template <class System>
inline constexpr bool has_series =
    detail::HasSeries<System, detail::fixed_size<typename System::State>()>;

}  // namespace ricochet::app
