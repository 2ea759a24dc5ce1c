// Random inclusions beside events that have nothing to do with them.
//
// Component 4 of a random inclusion, which no family uses, runs at a constant rate: a sawtooth of
// its own, set back at 1, moved by the ticks of a clock, that ends the run at its last tooth. Its
// times are known, and the motion of the rest must not notice it.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "random_inclusions.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::test {

/// The same inclusion without the reactions that it does not use.
template <int M, int N>
[[nodiscard]] RandomInclusion<M> without_unused(const RandomInclusion<N>& from)
{
    RandomInclusion<M> to;
    to.linear = from.linear;
    to.lever = from.lever.template leftCols<M>();
    to.seen = from.seen.template topRows<M>();
    to.slow = from.slow;
    to.fast = from.fast;
    to.frequency = from.frequency;
    to.phase = from.phase;
    to.lower = from.lower.template head<M>();
    to.upper = from.upper.template head<M>();
    to.weakening = from.weakening.template head<M>();
    to.root = from.root;
    to.start = from.start;
    to.t_end = from.t_end;
    to.reactions = M;
    return to;
}

/// The system of an inclusion, with the flow of its branches, and the sawtooth beside it.
template <int M>
struct WithSawtooth {
    using State = std::array<double, 6>;

    RandomInclusion<M> inclusion;
    double rate = 1;        ///< [1/s] of the sawtooth
    double period = 1;      ///< [s] of the clock
    double kick = 0;        ///< of the sawtooth at each tick
    std::size_t teeth = 1;  ///< at the last of which the run ends

    static WithSawtooth make(const RandomInclusion<M>& of, std::uint64_t seed)
    {
        Draw draw(seed * 77 + 5);
        WithSawtooth system{.inclusion = of};
        system.rate = draw.uniform(3, 20) / of.t_end;
        system.period = of.t_end / draw.uniform(2, 9);
        system.kick = draw.uniform(-0.2, 0.2);
        system.teeth = 1 + static_cast<std::size_t>(draw.uniform(0, 8));
        system.inclusion.linear(4, 5) = system.rate;  // component 5 is 1
        return system;
    }

    [[nodiscard]] RandomInclusion<M> set_valued() const { return inclusion; }

    void flow(double t, const State& x, State& dxdt) const
    {
        const Eigen::Map<const Eigen::Matrix<double, 6, 1>> w(x.data());
        Eigen::Matrix<double, 6, 1> f;
        inclusion.smooth(t, w, f);
        for (int k = 0; k < inclusion.reactions; ++k) {
            const double y = inclusion.seen.row(k).dot(w);
            const double r = inclusion.branch_bound(t, w, k, y > 0 ? Branch::lower : Branch::upper);
            if (std::isfinite(r)) f += inclusion.lever.col(k) * r;
        }
        for (std::size_t i = 0; i < 6; ++i) dxdt[i] = f[static_cast<Eigen::Index>(i)];
    }
    [[nodiscard]] std::size_t guard_count() const { return 1 + M; }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const
    {
        GuardInfo info;
        if (i > 0) {
            info.name = "y";
            info.crossing = Crossing::either;
            info.resets = false;
            return info;
        }
        info.name = "tooth";
        info.crossing = Crossing::rising;
        info.stop_after = static_cast<std::uint32_t>(teeth);
        return info;
    }
    [[nodiscard]] double guard(std::size_t i, double, const State& x) const
    {
        if (i == 0) return x[4] - 1;
        const Eigen::Map<const Eigen::Matrix<double, 6, 1>> w(x.data());
        return inclusion.seen.row(static_cast<Eigen::Index>(i) - 1).dot(w);
    }
    void reset(std::size_t i, double, State& x) const
    {
        if (i == 0) x[4] = 0;
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return (std::floor(t / period * (1 + 1e-15)) + 1) * period;
    }
    void time_reset(double, State& x) const { x[4] += kick; }

    /// Times of the teeth up to the last, or to the end.
    [[nodiscard]] std::vector<double> expected() const
    {
        std::vector<double> times;
        double t = 0, x = 0, tick = period;
        while (times.size() < teeth) {
            const double tooth = t + (1 - x) / rate;
            if (std::min(tooth, tick) > inclusion.t_end) break;
            if (tooth < tick) {
                times.push_back(t = tooth);
                x = 0;
            } else {
                x += rate * (tick - t) + kick;
                t = tick;
                if (x >= 1) {
                    times.push_back(t);
                    x = 0;
                }
                tick += period;
            }
        }
        return times;
    }
};

}  // namespace ricochet::test
