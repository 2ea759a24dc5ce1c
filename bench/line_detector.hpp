// The rival that knows: for a ball in free fall the boundary between steps that
// meet the floor and steps that do not is one line.
#pragma once

#include "ricochet/detect/ends.hpp"

namespace ricochet::bench {

/// Clears a step of h exactly where u / (g h²) + v / (g h) > 1/2, that is
/// u + v h > g h² / 2; for guards of constant curvature -g only.
struct Line {
    static constexpr bool uses_rates = false;
    static constexpr bool checks_every_step = false;

    template <class System, class X>
    void check(const System&, const X&, double /*smallest*/, double /*largest*/) const noexcept
    {
    }

    template <class Guard, class Step>
    [[nodiscard]] bool clears(const Guard& guard, const Step& step) const noexcept
    {
        const double h = step.h();
        const auto& x = step.x0();
        const double gravity = -guard.system().guard_curvature(step.time(0), x);
        return x[0] + h * (x[1] - 0.5 * h * gravity) > 0;
    }

    /// As the bare network does: an event of an earlier step, cleared in error, is late.
    template <class Guard, class Step>
    [[nodiscard]] Finding confirm(const Guard& guard, const Step& step, Watch& watch) const
    {
        Finding finding = Ends{}.confirm(guard, step, watch);
        if (finding.hit) {
            finding.lo.value = guard.value(step.time(0), step.x0());
            finding.late = side_of(finding.lo.value) == opposite(finding.side);
        }
        return finding;
    }
};

}  // namespace ricochet::bench
