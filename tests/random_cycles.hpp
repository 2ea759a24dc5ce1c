// Cycles of events over one to five guards that accumulate, with limits in closed form.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "ricochet/integrate.hpp"

namespace ricochet::test {

/// An automaton put together from functions. Mode 7 is that of rest, in which nothing happens.
struct Cycle {
    using State = std::array<double, 4>;
    static constexpr Mode at_rest = 7;
    std::size_t guards = 2;
    std::function<void(Mode, const State&, State&)> f;
    std::function<double(std::size_t, Mode, const State&)> g;
    std::function<Mode(std::size_t, Mode, State&)> r;
    std::function<bool(std::size_t, Mode)> on = [](std::size_t, Mode) { return true; };

    [[nodiscard]] std::size_t guard_count() const { return guards; }
    [[nodiscard]] static std::size_t mode_count() { return 8; }
    void flow(Mode mode, double, const State& x, State& dxdt) const
    {
        dxdt = {};
        if (mode != at_rest) f(mode, x, dxdt);
    }
    [[nodiscard]] double guard(std::size_t i, Mode mode, double, const State& x) const
    {
        return g(i, mode, x);
    }
    Mode reset(std::size_t i, Mode mode, double, State& x) const { return r(i, mode, x); }
    [[nodiscard]] bool enabled(std::size_t i, Mode mode) const
    {
        return mode != at_rest && on(i, mode);
    }
};

/// The same, coming to rest at the limit.
struct RestingCycle : Cycle {
    static Mode rest(std::size_t, Mode, double, State&) { return at_rest; }
};

struct CycleCase {
    RestingCycle system;
    Cycle::State start{};
    double limit = 0;
    double slack = 0;  ///< of the limit itself, and of a method that is not exact here
};

/// Cycles of one kind, as random as the seed.
class RandomCycles {
public:
    explicit RandomCycles(std::uint64_t seed) : random_(seed) {}

    /// Parabolic hops from place to place: guard i is the height above place i while the motion is
    /// there, by the mode or by a component; or one guard for all places, by the mode.
    [[nodiscard]] CycleCase hops()
    {
        const bool toggles = integer(0, 3) == 0;
        const int n = toggles ? integer(2, 3) : integer(2, 5);
        const bool moded = toggles || integer(0, 1) == 1;
        const bool disables = moded && !toggles && integer(0, 1) == 1;
        const bool alike = integer(0, 2) == 0;
        std::vector<double> place, restitution, gravity;
        double product = 0;
        while (!(product < 0.8 && product > 0.005)) {
            place.clear(), restitution.clear(), gravity.clear();
            product = 1;
            for (int i = 0; i < n; ++i) {
                place.push_back(alike && i > 0 ? place[0] : height());
                restitution.push_back(integer(0, 1) == 1 ? uniform(0.3, 0.95) : uniform(0.5, 1.3));
                gravity.push_back(uniform(1, 10));
                product *= restitution.back();
            }
        }
        const auto at = [=](Mode mode, const Cycle::State& x) {
            return static_cast<std::size_t>(moded ? static_cast<double>(mode) : x[2]);
        };
        const auto next = [=](std::size_t i) { return (i + 1) % static_cast<std::size_t>(n); };
        CycleCase hops;
        Cycle& system = hops.system;
        system.guards = toggles ? 1 : static_cast<std::size_t>(n);
        system.f = [=](Mode mode, const auto& x, auto& dxdt) {
            dxdt = {x[1], -gravity[at(mode, x)], 0, 0};
        };
        system.g = [=](std::size_t i, Mode mode, const auto& x) {
            if (mode == Cycle::at_rest) return 1.0;
            const std::size_t here = at(mode, x);
            if (toggles) return x[0] - place[here];
            return disables || here == i ? x[0] - place[i] : 1.0;
        };
        system.on = [=](std::size_t i, Mode mode) { return !disables || mode == i; };
        system.r = [=](std::size_t i, Mode mode, auto& x) -> Mode {
            const std::size_t here = toggles ? mode : i;
            x[0] = place[next(here)];
            x[1] *= -restitution[here];
            if (moded) return static_cast<Mode>(next(here));
            x[2] = static_cast<double>(next(here));
            return mode;
        };
        hops.start = {place[0], uniform(0.5, 3), 0, 0};
        std::size_t k = 0;
        for (double v = hops.start[1]; v > 1e-40; v *= restitution[k], k = next(k)) {
            hops.limit += 2 * v / gravity[k];
        }
        hops.slack = rounding(hops.limit);
        return hops;
    }

    /// Two tanks that are drained, and filled in turn: when one is empty the inflow changes to it.
    /// Together they are empty at the limit.
    [[nodiscard]] CycleCase tanks()
    {
        const std::array<double, 2> level = {height(), height()};
        const std::array<double, 2> drain = {uniform(1, 5), uniform(1, 5)};
        const double most = std::max(drain[0], drain[1]), sum = drain[0] + drain[1];
        return tanks(level, drain, most + uniform(0.05, 0.95) * (sum - most),
                     {level[0] + uniform(0.5, 2), level[1] + uniform(0.5, 2)}, integer(0, 1) == 1);
    }
    [[nodiscard]] static CycleCase tanks(const std::array<double, 2>& level,
                                         const std::array<double, 2>& drain, double inflow,
                                         const std::array<double, 2>& start, bool moded)
    {
        CycleCase tanks;
        Cycle& system = tanks.system;
        system.f = [=](Mode mode, const auto& x, auto& dxdt) {
            dxdt = {-drain[0], -drain[1], 0, 0};
            dxdt[moded ? mode : static_cast<std::size_t>(x[2])] += inflow;
        };
        system.g = [=](std::size_t i, Mode, const auto& x) { return x[i] - level[i]; };
        system.r = [=](std::size_t i, Mode mode, auto& x) -> Mode {
            x[i] = level[i];
            if (moded) return static_cast<Mode>(i);
            x[2] = static_cast<double>(i);
            return mode;
        };
        tanks.start = {start[0], start[1], 0, 0};
        const double water = (start[0] - level[0]) + (start[1] - level[1]);
        tanks.limit = water / (drain[0] + drain[1] - inflow);
        // Each event may lose a rounding of the level.
        const double most = std::max(std::fabs(start[0]), std::fabs(start[1]));
        tanks.slack = rounding(tanks.limit) + 100 * rounding(most) / (drain[0] + drain[1] - inflow);
        return tanks;
    }

    /// A saddle x'' = x between guards at -p and p, that are exchanged by each reset; also a block
    /// that rocks on its two corners, since there x'' = x - p or x + p with a guard of x.
    [[nodiscard]] CycleCase saddle()
    {
        const double p = integer(0, 1) == 1 ? 1 : std::pow(10, uniform(-2, 4));
        return saddle(p, p * uniform(0.05, 0.6), uniform(0.3, 0.6), integer(0, 1) == 1);
    }
    [[nodiscard]] static CycleCase saddle(double p, double start, double restitution, bool disables)
    {
        CycleCase saddle;
        Cycle& system = saddle.system;
        system.f = [](Mode, const auto& x, auto& dxdt) { dxdt = {x[1], x[0], 0, 0}; };
        system.g = [=](std::size_t i, Mode, const auto& x) { return i == 0 ? p - x[0] : p + x[0]; };
        system.on = [=](std::size_t i, Mode mode) { return !disables || mode == i; };
        system.r = [=](std::size_t i, Mode mode, auto& x) -> Mode {
            x[0] = -x[0];
            x[1] *= restitution;
            return disables ? static_cast<Mode>(1 - i) : mode;
        };
        saddle.start = {start, 0, 0, 0};
        saddle.limit = std::acosh(p / start);
        for (double v = restitution * std::sqrt(p * p - start * start); v > 1e-30;) {
            saddle.limit += 2 * std::atanh(v / p);
            v *= restitution;
        }
        saddle.slack = 1e-9 * saddle.limit;
        return saddle;
    }

    /// One of these.
    [[nodiscard]] CycleCase any()
    {
        const int kind = integer(0, 3);
        return kind == 0 ? tanks() : kind == 1 ? saddle() : hops();
    }

private:
    [[nodiscard]] double uniform(double lo, double hi)
    {
        return std::uniform_real_distribution<>(lo, hi)(random_);
    }
    [[nodiscard]] int integer(int lo, int hi)
    {
        return std::uniform_int_distribution<>(lo, hi)(random_);
    }
    /// From 0 to 1e6, with both the rounding of zero and that of a million.
    [[nodiscard]] double height()
    {
        switch (integer(0, 4)) {
            case 0: return 0;
            case 1: return 1;
            case 2: return uniform(-30, 30);
            case 3: return std::pow(10, uniform(-3, 6));
            default: return std::floor(uniform(-100, 100));
        }
    }
    [[nodiscard]] static double rounding(double x)
    {
        return 8 * std::numeric_limits<double>::epsilon() * std::fabs(x);
    }

    std::mt19937_64 random_;
};

/// What is wrong with a run of the case; empty: nothing.
template <class X>
[[nodiscard]] std::string fault_of(const CycleCase& of, const Run<X>& run)
{
    if (run.outcome != Outcome::reached_end) return std::string(name(run.outcome));
    for (const auto& event : run.events) {
        if (event.kind != EventKind::accumulation) continue;
        const double off = std::fabs(event.t - of.limit);
        if (!(off <= event.error + of.slack)) {
            return "limit off by " + std::to_string(off / event.error) + " times its error";
        }
        if (!(event.error <= 0.5 * of.limit)) return "no error stated";
        return "";
    }
    return "no limit";
}

/// Runs the case for longer than its limit, with a bound on its steps.
template <class Stepping>
[[nodiscard]] std::string fault_of(const CycleCase& of, const Stepping& stepping, double step = 0)
{
    return fault_of(of, integrate(of.system, of.start,
                                  {.t_end = 2 * of.limit + 1,
                                   .step = step,
                                   .rtol = 1e-12,
                                   .atol = 1e-14,
                                   .max_steps = 200'000},
                                  stepping, Extremum{}, Newton{}));
}

/// Clocks with guards 1/8 - x_i, whose resets start them again.
struct Clocks {
    using State = std::array<double, 6>;
    static constexpr std::size_t guard_count = 6;
    void flow(double, const State&, State& dxdt) const { dxdt.fill(1); }
    [[nodiscard]] double guard(std::size_t i, double, const State& x) const { return 0.125 - x[i]; }
    void reset(std::size_t i, double, State& x) const { x[i] = 0; }
};

/// Runs clocks that are late by these multiples of 2^-53 s. False: one of their events is
/// missing, or they were taken to accumulate.
[[nodiscard]] inline bool clocks_run(const std::array<int, 6>& late)
{
    Clocks::State x{};
    for (std::size_t i = 0; i < 6; ++i) x[i] = -0x1p-53 * late[i];
    const auto run = integrate(Clocks{}, x, {.t_end = 5.06, .max_steps = 10'000});
    return run.outcome == Outcome::reached_end && run.statistics.events == 240;
}

}  // namespace ricochet::test
