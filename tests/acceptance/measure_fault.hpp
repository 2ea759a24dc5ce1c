// Checks of the strike-slip fault.
#pragma once

#include "measure.hpp"

namespace ricochet::bench {

[[nodiscard]] Measured rupture_one_element();
[[nodiscard]] Measured rupture_published_kernels();
[[nodiscard]] Measured repeat_published_scheme();
[[nodiscard]] Measured observe_order_through_arrests();
[[nodiscard]] Measured rupture_100();
[[nodiscard]] Measured rupture_200();
[[nodiscard]] Measured bathe_100();
[[nodiscard]] Measured table_of_meshes();

/// With rate-and-state friction.
[[nodiscard]] Measured compare_fault_with_slider();
[[nodiscard]] Measured observe_orders_on_fault();
[[nodiscard]] Measured solve_random_stages();
[[nodiscard]] Measured cycle_25();
[[nodiscard]] Measured cycle_50();

}  // namespace ricochet::bench
