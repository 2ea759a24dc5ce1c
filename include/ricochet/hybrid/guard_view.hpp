// A system's guard as detectors and locators use it: evaluations are counted,
// and the rate is there whether or not the system has one in closed form.
#pragma once

#include <cstdint>
#include <limits>

#include "ricochet/hybrid/components.hpp"
#include "ricochet/hybrid/system.hpp"

namespace ricochet {

/// The guard at one time inside a step. The rate is NaN where nobody asked for it.
struct GuardSample {
    double s = 0;      ///< [s] offset from the start of the step
    double value = 0;  ///< g
    double rate = std::numeric_limits<double>::quiet_NaN();  ///< dg/dt along the flow
};

template <class System, class X>
class GuardView {
public:
    using State = X;

    /// Keeps references to both; `calls` is incremented at every evaluation.
    GuardView(const System& system, std::uint64_t& calls) noexcept
        : system_(&system), calls_(&calls)
    {
    }

    [[nodiscard]] const System& system() const noexcept { return *system_; }
    [[nodiscard]] Crossing crossing() const noexcept { return crossing_of(*system_); }

    /// Counts an evaluation that somebody else makes.
    void count() const noexcept { ++*calls_; }

    [[nodiscard]] double value(double t, const X& x) const
    {
        count();
        return system_->guard(t, x);
    }

    /// dg/dt at (t, x) with x' = dxdt: `guard_rate` of the system, else the central
    /// difference along the flow over 1e-5 of the time `scale` [s] to either side:
    /// its truncation error is 1e-10 scale^2 / 6 times the third derivative, and it
    /// magnifies rounding in g by 1e5 / scale.
    [[nodiscard]] double rate(double t, const X& x, const X& dxdt, double scale) const
    {
        if constexpr (RatedGuard<System, X>) {
            return system_->guard_rate(t, x, dxdt);
        } else {
            const double delta = 1e-5 * scale;
            X moved = x;
            detail::move(moved, x, delta, dxdt);
            const double ahead = value(t + delta, moved);
            detail::move(moved, x, -delta, dxdt);
            const double behind = value(t - delta, moved);
            return (ahead - behind) / (2 * delta);
        }
    }

private:
    const System* system_;
    std::uint64_t* calls_;
};

}  // namespace ricochet
