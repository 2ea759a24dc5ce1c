// Families of systems with random constants: polynomial, trigonometric and rational flows with
// nonlinear guards, and motions that are reflected by a wall.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <string>

#include "ricochet/integrate.hpp"
#include "ricochet/taylor/taylor.hpp"
#include "taylor/long_double_events.hpp"

namespace ricochet::test {

using Draw = std::mt19937_64;

[[nodiscard]] inline double drawn(Draw& draw, double lo, double hi)
{
    return lo + (hi - lo) * static_cast<double>(draw() >> 11) * 0x1p-53;
}

/// A guard of second degree in the state, with the time.
template <class Flow>
struct Recorded2 : Flow {
    using State = std::array<double, 2>;
    static constexpr Crossing crossing = Crossing::either;
    static constexpr bool resets = false;
    std::array<double, 6> g{1, 1, 1, 1, 1, 1};

    template <class S>
    [[nodiscard]] constexpr S guard(const S& t, const std::array<S, 2>& x) const
    {
        using std::sin;
        return (g[0] * x[0] + g[1] * x[1] - g[2]) + (g[3] * x[0] * x[0] + g[4] * x[0] * x[1]) +
               g[5] * sin(1.3 * t);
    }
    void draw(Draw& from)
    {
        for (double& c : this->c) c = drawn(from, -1, 1);
        for (double& c : g) c = drawn(from, -1, 1);
    }
    [[nodiscard]] static State start(Draw& from)
    {
        return {drawn(from, -1, 1), drawn(from, -1, 1)};
    }
};

struct PolynomialFlow {
    std::array<double, 6> c{1, 1, 1, 1, 1, 1};
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        // Cubic terms keep the motion bounded.
        const S r2 = x[0] * x[0] + x[1] * x[1];
        dxdt[0] = 2.0 * x[1] + c[0] * x[0] + c[1] * x[0] * x[1] - x[0] * r2;
        dxdt[1] =
            -2.0 * x[0] + c[2] * x[1] + c[3] * x[0] * x[0] - x[1] * r2 + c[4] * t * 0.1 + c[5];
    }
};

struct TrigonometricFlow {
    std::array<double, 6> c{1, 1, 1, 1, 1, 1};
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cos, std::sin;
        dxdt[0] = x[1] + c[0] * sin(x[0] + c[1]);
        dxdt[1] = -2.0 * sin(x[0]) + c[2] * cos(1.7 * t) - 0.1 * x[1] + c[3] * cos(x[1] + c[4]);
    }
};

struct RationalFlow {
    std::array<double, 6> c{1, 1, 1, 1, 1, 1};
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sqrt;
        const S d = 1.0 / (1.0 + x[0] * x[0]);
        dxdt[0] = x[1] + c[0] * d;
        dxdt[1] = c[1] * x[1] * d - 1.5 * x[0] + c[2] / sqrt(1.5 + x[1] * x[1]) +
                  c[3] / (2.0 + t * t) - 0.2 * x[1];
    }
};

/// A forced oscillator beside a wall that moves.
struct MovingWall {
    using State = std::array<double, 2>;
    static constexpr bool resets = true;
    static constexpr bool unilateral = true;
    double force = 1, place = 0.5, swing = 0.1, pace = 1.1, restitution = 0.8;

    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cos;
        dxdt[0] = x[1];
        dxdt[1] = force * cos(1.9 * t) - 2.0 * x[0] - 0.1 * x[1];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& t, const std::array<S, 2>& x) const
    {
        using std::sin;
        return place + swing * sin(pace * t) - x[0];
    }
    template <class S>
    void reset(const S& t, std::array<S, 2>& x) const
    {
        using std::cos, std::sin;
        const S wall = swing * pace * cos(pace * t);
        x[0] = place + swing * sin(pace * t);
        x[1] = wall - restitution * (x[1] - wall);
    }
    void draw(Draw& from)
    {
        force = drawn(from, 0.5, 3);
        place = drawn(from, 0.2, 1);
        swing = drawn(from, -0.15, 0.15);
        pace = drawn(from, 0.3, 2);
        restitution = drawn(from, 0.5, 1);
    }
    [[nodiscard]] static State start(Draw& from)
    {
        return {drawn(from, -1, 0), drawn(from, -1, 1)};
    }
};

/// A point in a bowl with a round wall, at which it is reflected.
struct RoundWall {
    using State = std::array<double, 4>;
    static constexpr bool resets = true;
    static constexpr bool unilateral = true;
    double bend = 1, radius = 0.8, restitution = 0.9;

    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -x[0] - 2.0 * bend * x[0] * x[1];
        dxdt[3] = bend * (x[1] * x[1] - x[0] * x[0]) - x[1];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 4>& x) const
    {
        return radius * radius - x[0] * x[0] - x[1] * x[1];
    }
    template <class S>
    void reset(const S& /*t*/, std::array<S, 4>& x) const
    {
        const S outward =
            (1 + restitution) * (x[0] * x[2] + x[1] * x[3]) / (x[0] * x[0] + x[1] * x[1]);
        x[2] -= outward * x[0];
        x[3] -= outward * x[1];
    }
    void draw(Draw& from)
    {
        bend = drawn(from, 0, 1);
        radius = drawn(from, 0.3, 0.8);
        restitution = drawn(from, 0.7, 1);
    }
    [[nodiscard]] static State start(Draw& from)
    {
        return {drawn(from, -0.2, 0.2), drawn(from, -0.2, 0.2), drawn(from, -1, 1),
                drawn(from, -1, 1)};
    }
};

/// Results of runs of random systems of one family.
struct RandomRuns {
    std::size_t runs = 0, doubtful = 0, events = 0;
    std::size_t missed = 0, spurious = 0, misplaced = 0;
    double worst = 0;     ///< error of a time, times the slope of the guard there
    std::string first{};  ///< the first error
};

template <class System>
void compare_random_run(Draw& from, RandomRuns& out)
{
    constexpr double t_end = 5;
    constexpr double tolerance = 1e-9;  // bound to which errors of 1e-13 per step may grow in that
                                        // time
    System system;
    system.draw(from);
    const typename System::State x0 = System::start(from);
    const auto run = integrate(system, x0, {.t_end = t_end, .rtol = 1e-13, .atol = 1e-13},
                               ErrorControlled<Taylor>{});
    const LongDoubleMotion<System, std::tuple_size_v<typename System::State>> motion(system, x0,
                                                                                     0.05L);
    const auto reset = [&](Real t, auto& x) {
        if constexpr (System::resets) system.reset(t, x);
    };
    const ExpectedEvents expected = expected_events(motion, t_end, System::resets, reset);
    ++out.runs;
    if (expected.doubtful) {
        ++out.doubtful;
        return;
    }
    out.events += expected.t.size();
    const std::size_t found = run.events.size(), exact = expected.t.size();
    const auto say = [&](const char* what) {
        if (out.first.empty())
            out.first = std::string(what) + " in run " + std::to_string(out.runs);
    };
    if (found < exact) out.missed += exact - found, say("missed");
    if (found > exact) out.spurious += found - exact, say("spurious");
    if (found != exact) return;
    for (std::size_t i = 0; i < exact; ++i) {
        const double error = static_cast<double>(std::fabs(run.events[i].t - expected.t[i]) *
                                                 std::fmin(std::fabs(expected.slope[i]), 1.0L));
        out.worst = std::fmax(out.worst, error);
        if (!(error <= tolerance)) ++out.misplaced, say("misplaced");
    }
}

}  // namespace ricochet::test
