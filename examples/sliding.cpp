// Dry friction: a block on a spring swings back and forth, and sticks.
//
// Friction is 0.3 against the motion, so that two smooth fields meet at velocity 0.
// `Filippov` makes a hybrid system of them: where both lead to the surface, the motion
// slides along it, which here is sticking.

#include <array>
#include <cstddef>
#include <cstdio>

#include "ricochet/ricochet.hpp"

struct BlockOnSpring {
    static constexpr std::size_t surface_count = 1;

    // x = (position [m], velocity [m/s]); mass 1 kg, spring 1 N/m
    template <class X>
    double surface(std::size_t, double, const X& x) const
    {
        return x[1];
    }

    template <class X>
    double surface_rate(std::size_t, double, const X&, const X& dxdt) const
    {
        return dxdt[1];
    }

    template <class X>
    void field(std::size_t region, double, const X& x, X& dxdt) const
    {
        const bool forward = region & 1;  // velocity > 0
        dxdt[0] = x[1];
        dxdt[1] = -x[0] + (forward ? -0.3 : 0.3);
    }
};

int main()
{
    const ricochet::Filippov<BlockOnSpring> block;
    const std::array x0 = {2.0, 0.0};
    const auto run = ricochet::integrate(block, x0, {.t_end = 12, .mode = block.start_mode(0, x0)});

    for (const auto& event : run.events) {
        std::printf("%.9f s at %+.6f m: %s -> %s\n", event.t, event.after[0],
                    block.mode_name(event.mode_before).data(),
                    block.mode_name(event.mode_after).data());
    }
    // The friction force while sticking is the average of the two bounds with these weights.
    const double share = block.shares(run.mode, run.t, run.x)[0];
    std::printf("at %.0f s %+.6f m, friction %+.6f N\n", run.t, run.x[0], 0.3 - 0.6 * share);
    return run.events.size() == 3 && run.x[1] == 0 ? 0 : 1;
}
