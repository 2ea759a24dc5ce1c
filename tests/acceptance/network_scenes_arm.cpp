// Networks on the arm, and on its projection through a pinhole.
#include <fmt/format.h>

#include "measure_networks.hpp"
#include "problems/opaque.hpp"
#include "problems/planar_arm.hpp"

namespace ricochet::bench {

namespace {

using Fixed = FixedStep<Rk4>;

Options every_ms(double t_end)
{
    return {.t_end = t_end, .step = 1e-3};
}

/// A network of single steps must know its system.
template <class System>
struct Named : System {
    using System::System;
    static constexpr std::string_view name = "opaque";
};

template <std::size_t N>
void add_times(std::vector<MeteredRow>& rows)
{
    for (const std::size_t obstacles : {8U, 40U}) {
        time_metered<Fixed>(rows, fmt::format("arm of {} joints, {} obstacles", N, obstacles),
                            PlanarArm<N>({.obstacles = obstacles}), every_ms(60), 1e-3, 0.3);
    }
}

}  // namespace

void add_arm_events(std::vector<SameEvents>& scenes)
{
    scenes.push_back(same_events<Fixed>("(c) arm of 4 joints, 8 obstacles", "arm",
                                        PlanarArm<4>({.obstacles = 8}), every_ms(200), 1e-3));
    scenes.push_back(same_events<Fixed>("(c) arm of 6 joints, 40 obstacles", "arm",
                                        PlanarArm<6>({.obstacles = 40}), every_ms(200), 1e-3));
    const PlanarArm<4> arm({.obstacles = 8});
    scenes.push_back(same_events<Fixed>("(d) black box around the arm of 4 joints", "opaque",
                                        Named<BlackBox<PlanarArm<4>>>(arm, 0), every_ms(200),
                                        1e-3));
    scenes.push_back(same_events<Fixed>("(g) the arm of 4 joints, its value alone", "opaque",
                                        Named<Hidden<PlanarArm<4>>>(arm, 0), every_ms(200), 1e-3));
}

void add_arm_times(std::vector<MeteredRow>& rows)
{
    add_times<4>(rows);
    add_times<6>(rows);
}

}  // namespace ricochet::bench
