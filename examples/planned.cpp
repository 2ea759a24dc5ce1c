// A ball falls through a forest of pegs. The guard, its distance to the nearest of a thousand pegs,
// is expensive; bounds on its rate of change determine when it need not be evaluated.

#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "ricochet/ricochet.hpp"

namespace {

struct Pegboard {
    using State = std::array<double, 4>;  // x, y [m], velocity [m/s]
    static constexpr double radius = 0.3;
    static constexpr double restitution = 0.5;
    static constexpr double gravity = 9.81;
    std::vector<std::array<double, 2>> pegs;

    Pegboard()
    {
        for (int row = 0; row < 40; ++row) {
            for (int column = 0; column < 25; ++column) {
                pegs.push_back({column + 0.5 * (row % 2), -1.0 * row});
            }
        }
    }

    [[nodiscard]] const std::array<double, 2>& nearest(const State& x) const
    {
        const std::array<double, 2>* best = &pegs.front();
        double least = 1e300;
        for (const auto& peg : pegs) {
            const double away = std::hypot(x[0] - peg[0], x[1] - peg[1]);
            if (away < least) {
                least = away;
                best = &peg;
            }
        }
        return *best;
    }

    void flow(double, const State& x, State& dxdt) const { dxdt = {x[2], x[3], 0, -gravity}; }

    [[nodiscard]] double guard(double, const State& x) const
    {
        const auto& peg = nearest(x);
        return std::hypot(x[0] - peg[0], x[1] - peg[1]) - radius;
    }

    void reset(double, State& x) const
    {
        const auto& peg = nearest(x);
        const double away = std::hypot(x[0] - peg[0], x[1] - peg[1]);
        const std::array<double, 2> normal = {(x[0] - peg[0]) / away, (x[1] - peg[1]) / away};
        const double speed = x[2] * normal[0] + x[3] * normal[1];
        x[2] -= (1 + restitution) * speed * normal[0];
        x[3] -= (1 + restitution) * speed * normal[1];
    }

    // The distance changes no faster than the ball moves, whose speed grows by gravity.
    [[nodiscard]] double speed_bound(double, const State& x) const
    {
        return std::hypot(x[2], x[3]);
    }
    [[nodiscard]] double acceleration_bound(double, const State&) const { return gravity; }
};

}  // namespace

int main()
{
    using namespace ricochet;
    const Pegboard board;
    const Pegboard::State start = {12.01, 1, 0, 0};
    const Options options{.t_end = 20, .step = 1e-3};
    const FixedStep<Rk4> rk4;
    const auto looked = integrate(board, start, options, rk4, Extremum{});
    const auto planned = integrate(board, start, options, rk4, Planned{});

    std::printf("%zu impacts, from %.1f m down to %.1f m\n", planned.events.size(), start[1],
                planned.x[1]);
    std::printf("distances to the pegs: %llu at every step, %llu planned\n",
                static_cast<unsigned long long>(looked.statistics.guard_calls),
                static_cast<unsigned long long>(planned.statistics.guard_calls));
    bool same = looked.events.size() == planned.events.size() && looked.x == planned.x;
    for (std::size_t i = 0; same && i < looked.events.size(); ++i) {
        same = looked.events[i].t == planned.events[i].t;
    }
    std::printf("impacts at %s times\n", same ? "the same" : "OTHER");
    return same && 3 * planned.statistics.guard_calls < looked.statistics.guard_calls ? 0 : 1;
}
