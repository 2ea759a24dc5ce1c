// The problems of the report, each written once for all peers.
//
// A system is declared as for ricochet: flow, guards, resets, modes. Peers use it through `Seen`
// (seen.hpp). Flows are templates over scalar and state, so that one definition serves arrays,
// vectors, plain memory and power series.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"

namespace ricochet::report {

using Two = std::array<double, 2>;
using Four = std::array<double, 4>;

/// An event of the reference.
struct Expected {
    double t = 0;  ///< [s]
    std::size_t guard = 0;
};

/// A system, its start and its reference solution.
template <class System>
struct Task {
    System system{};
    typename System::State x0{};
    double t_end = 0;                            ///< [s]
    std::vector<Expected> events{};              ///< ascending for each guard
    double scored_until = INFINITY;              ///< [s] later events are not compared
    std::vector<double> sample_times{};          ///< [s]; empty: events are compared
    std::vector<std::vector<double>> samples{};  ///< states there
    double first_step = 1e-2;  ///< [s] for peers that do not choose one themselves
};

// --- ball ---

struct Ball {
    using State = Two;
    static constexpr bool unilateral = true;
    double gravity = 9.81;     ///< [m/s²]
    double restitution = 0.9;  ///< [-]

    template <class T, class X>
    constexpr void flow(const T& /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity;
    }
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(const T& /*t*/, const X& x) const
    {
        return x[0];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return dxdt[0];
    }
    template <class X>
    void reset(double /*t*/, X& x) const
    {
        x[0] = 0;
        x[1] *= -restitution;
    }
};

/// 13 impacts: t1 = sqrt(2 h / g), t_{n+1} = t_n + 2 t1 e^n.
[[nodiscard]] inline Task<Ball> ball()
{
    Task<Ball> task{.x0 = {10, 0}, .t_end = 20.5};
    const BouncingBall known({.gravity = task.system.gravity, .restitution = 0.9});
    for (int n = 0; known.impact_time(n, 10, 0) <= task.t_end; ++n) {
        task.events.push_back({known.impact_time(n, 10, 0), 0});
    }
    return task;
}

// --- impact oscillator ---

struct Impacts {
    using State = Two;
    static constexpr bool unilateral = true;
    double frequency = 0.8;
    double wall = 1.2;
    double restitution = 0.8;
    double damping = 0.1;

    template <class T, class X>
    constexpr void flow(const T& t, const X& x, X& dxdt) const
    {
        using std::cos;
        dxdt[0] = x[1];
        dxdt[1] = cos(frequency * t) - x[0] - damping * x[1];
    }
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(const T& /*t*/, const X& x) const
    {
        return wall - x[0];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return -dxdt[0];
    }
    template <class X>
    void reset(double /*t*/, X& x) const
    {
        x[0] = wall;
        x[1] *= -restitution;
    }
};

/// Between impacts a sum of two oscillations, followed in long double by `impacts` of
/// the ready system.
[[nodiscard]] inline Task<Impacts> impact_oscillator(double wall, int periods)
{
    Task<Impacts> task{.system = {.wall = wall}, .x0 = {0, 0}};
    const ImpactOscillator known(
        {.frequency = 0.8, .wall = wall, .restitution = 0.8, .damping = 0.1});
    task.t_end = periods * known.period();
    for (const double t : known.impacts(task.t_end)) task.events.push_back({t, 0});
    return task;
}

// --- near-tangent crossings ---

/// Oscillators of unit amplitude whose crests are `depth` above the guard's level: pairs of
/// crossings that are close together. Each of them is a run of its own.
struct NearTangentPairs {
    using State = Two;
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::either;
    double depth = 1e-4;

    template <class T, class X>
    constexpr void flow(const T& /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    /// y - 1 is exact near a crest, where 1 - depth would lose digits of the depth.
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(const T& /*t*/, const X& x) const
    {
        return (x[0] - 1.0) + depth;
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return dxdt[0];
    }
};

/// y = cos(t + phase), crossings at 2 pi n - phase +- 2 asin(sqrt(depth / 2)).
[[nodiscard]] inline Task<NearTangentPairs> near_tangent(double depth, double phase)
{
    Task<NearTangentPairs> task{
        .system = {.depth = depth}, .x0 = {std::cos(phase), -std::sin(phase)}, .t_end = 20};
    const double width = 2 * std::asin(std::sqrt(depth / 2));
    for (int n = 1; 2 * std::numbers::pi * n - phase - width < task.t_end; ++n) {
        for (const double s : {-width, width}) {
            const double t = 2 * std::numbers::pi * n - phase + s;
            if (t < task.t_end) task.events.push_back({t, 0});
        }
    }
    return task;
}

inline constexpr std::size_t tangent_phases = 32;
/// The phases are multiples of the golden section, so that no crest lies at the end.
[[nodiscard]] inline double tangent_phase(std::size_t k)
{
    const double golden = 0.6180339887498949 * static_cast<double>(k + 1);
    return 1.5 + 4 * (golden - std::floor(golden));
}

// --- surfaces of section ---

struct Section {
    using State = Four;
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::rising;

    template <class T, class X>
    constexpr void flow(const T& /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = -x[2] - 2.0 * x[2] * x[3];
        dxdt[1] = -x[3] - x[2] * x[2] + x[3] * x[3];
        dxdt[2] = x[0];
        dxdt[3] = x[1];
    }
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(const T& /*t*/, const X& x) const
    {
        return x[2];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return dxdt[2];
    }
};

/// The star of Henon and Heiles (Astronomical Journal 69, 1964), six passages; Taylor series in
/// arithmetic of 34 digits, as in the tests.
[[nodiscard]] inline Task<Section> henon_heiles()
{
    Task<Section> task{.x0 = {-0.2525875586263492, -0.2178423952983717, 0, 0.2587703282931232},
                       .t_end = 36};
    for (const double t : {4.2208334830171685797, 10.552008560025788047, 15.887489913811527472,
                           21.257937652710846512, 27.611348274257833980, 34.276637864819525341}) {
        task.events.push_back({t, 0});
    }
    return task;
}

/// The restricted three-body problem with the masses of E. Hairer, S. P. Norsett and G. Wanner,
/// Solving Ordinary Differential Equations I, Springer, 1993, page 130.
struct Arenstorf {
    using State = Four;
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::either;

    template <class T, class X>
    constexpr void flow(const T& /*t*/, const X& x, X& dxdt) const
    {
        using std::sqrt;
        constexpr double moon = 0.012277471;
        constexpr double earth = 1 - moon;
        const auto y2 = x[1] * x[1];
        const auto a = x[0] + moon;
        const auto b = x[0] - earth;
        const auto r1 = a * a + y2;
        const auto r2 = b * b + y2;
        const auto pull1 = earth / (r1 * sqrt(r1));
        const auto pull2 = moon / (r2 * sqrt(r2));
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = x[0] + 2.0 * x[3] - pull1 * a - pull2 * b;
        dxdt[3] = x[1] - 2.0 * x[2] - (pull1 + pull2) * x[1];
    }
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(const T& /*t*/, const X& x) const
    {
        return x[1];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return dxdt[1];
    }
};

[[nodiscard]] Task<Arenstorf> arenstorf();

// --- N balls in one state ---

struct Balls {
    using State = std::vector<double>;
    std::size_t balls = 1;

    [[nodiscard]] std::size_t guard_count() const { return balls; }
    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/)
    {
        return {.unilateral = true, .degree = 1};
    }
    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const
    {
        for (std::size_t i = 0; i < balls; ++i) {
            dxdt[2 * i] = x[2 * i + 1];
            dxdt[2 * i + 1] = -9.81;
        }
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const X& x) const
    {
        return x[2 * which];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double /*t*/, const X& /*x*/,
                                    const D& dxdt) const
    {
        return dxdt[2 * which];
    }
    template <class X>
    void reset(std::size_t which, double /*t*/, X& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= -0.9;
    }
};

/// From heights spread evenly over 5 to 10 m. There are about eight impacts a ball for few of them,
/// two for a hundred, and some 200 to 300 in all for a thousand and more.
[[nodiscard]] inline Task<Balls> balls(std::size_t n)
{
    Task<Balls> task{.system = {.balls = n}, .x0 = std::vector<double>(2 * n, 0.0)};
    task.t_end = n <= 10 ? 15 : n <= 100 ? 3 : n <= 1000 ? 1.1 : n <= 10000 ? 1.02 : 1.011;
    for (std::size_t i = 0; i < n; ++i) {
        const double height = 5 + 5 * (static_cast<double>(i) + 0.5) / static_cast<double>(n);
        task.x0[2 * i] = height;
        const BouncingBall known({.gravity = 9.81, .restitution = 0.9});
        for (int k = 0; known.impact_time(k, height, 0) <= task.t_end; ++k) {
            task.events.push_back({known.impact_time(k, height, 0), i});
        }
    }
    return task;
}

// --- stick-slip ---

/// A mass on a belt of speed 0.2, friction 1 / (1 + 3 s): slips, sticks, is pulled loose.
struct Belt {
    using State = Two;
    enum : Mode { slip, stick };
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 1;
    static constexpr double speed = 0.2;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/)
    {
        return {.degree = 1};
    }

    template <class T, class X>
    constexpr void flow(Mode mode, const T& /*t*/, const X& x, X& dxdt) const
    {
        if (mode == slip) {
            dxdt[0] = x[1];
            dxdt[1] = 1.0 / (1.0 + 3.0 * (speed - x[1])) - x[0];
        } else {
            dxdt[0] = speed;
            dxdt[1] = 0.0;
        }
    }
    template <class T, class X>
    [[nodiscard]] constexpr auto guard(std::size_t /*which*/, Mode mode, const T& /*t*/,
                                       const X& x) const
    {
        return mode == slip ? speed - x[1] : 1.0 - x[0];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t /*which*/, Mode mode, double /*t*/, const X& /*x*/,
                                    const D& dxdt) const
    {
        return mode == slip ? -dxdt[1] : -dxdt[0];
    }
    template <class X>
    [[nodiscard]] Mode reset(std::size_t /*which*/, Mode mode, double /*t*/, X& x) const
    {
        x[1] = speed;
        if (mode == slip) return stick;
        x[0] = 1;
        return slip;
    }
};

/// 100 periods; the times of re-sticking and of the period as in `StickSlip`, by Taylor series in
/// arithmetic of 34 digits.
[[nodiscard]] inline Task<Belt> stick_slip()
{
    constexpr double period = 12.001031294830578647;
    constexpr double stick = 4.2959995254801548834;
    Task<Belt> task{.x0 = {1, Belt::speed}, .t_end = 100.5 * period};
    for (int k = 0; k <= 100; ++k) {
        if (k > 0) task.events.push_back({k * period, 0});
        task.events.push_back({k * period + stick, 0});
    }
    return task;
}

// --- thermostat bank ---

/// n rooms of temperature x_i with heaters u_i that are 0 or 1.
struct Thermostats {
    using State = std::vector<double>;
    std::size_t rooms = 1;

    [[nodiscard]] std::size_t guard_count() const { return rooms; }
    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) { return {}; }
    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const
    {
        for (std::size_t i = 0; i < rooms; ++i) {
            dxdt[2 * i] = -0.1 * (x[2 * i] - 30 * x[2 * i + 1]);
            dxdt[2 * i + 1] = 0;
        }
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const X& x) const
    {
        return x[2 * which + 1] == 0 ? x[2 * which] - 18 : 22 - x[2 * which];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double /*t*/, const X& x,
                                    const D& dxdt) const
    {
        return x[2 * which + 1] == 0 ? dxdt[2 * which] : -dxdt[2 * which];
    }
    template <class X>
    void reset(std::size_t which, double /*t*/, X& x) const
    {
        x[2 * which + 1] = 1 - x[2 * which + 1];
    }
};

/// From temperatures spread over 18.5 to 21.5 with the heaters off; exponentials.
[[nodiscard]] inline Task<Thermostats> thermostats(std::size_t n)
{
    Task<Thermostats> task{
        .system = {.rooms = n}, .x0 = std::vector<double>(2 * n, 0.0), .t_end = 20};
    const double off = 10 * std::log(22.0 / 18);
    const double on = 10 * std::log(12.0 / 8);
    for (std::size_t i = 0; i < n; ++i) {
        const double from = 18.5 + 3 * (static_cast<double>(i) + 0.5) / static_cast<double>(n);
        task.x0[2 * i] = from;
        double t = 10 * std::log(from / 18);
        for (bool heated = true; t <= task.t_end; heated = !heated) {
            task.events.push_back({t, i});
            t += heated ? on : off;
        }
    }
    return task;
}

// --- guards that never fire ---

/// A pendulum of 1 m, with n guards far below it.
struct Watched {
    using State = Two;
    static constexpr bool resets = false;
    std::size_t guards_ = 1;

    [[nodiscard]] std::size_t guard_count() const { return guards_; }
    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.8 * std::sin(x[0]);
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const X& x) const
    {
        return x[0] + (10 + static_cast<double>(which));
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t /*which*/, double /*t*/, const X& /*x*/,
                                    const D& dxdt) const
    {
        return dxdt[0];
    }
};

/// The same without guards.
struct Unwatched {
    using State = Two;

    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        Watched{}.flow(t, x, dxdt);
    }
};

/// n / 2 harmonic oscillators in one state, without guards: the cost of the steps alone.
struct Rotations {
    using State = std::vector<double>;

    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const
    {
        for (std::size_t i = 0; i < n; i += 2) {
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = -x[i];
        }
    }
    std::size_t n = 2;
};

[[nodiscard]] inline Task<Rotations> rotations(std::size_t n)
{
    Task<Rotations> task{.system = {.n = n}, .x0 = std::vector<double>(n), .t_end = 20};
    for (std::size_t i = 0; i < n; ++i) task.x0[i] = 1.0 / static_cast<double>(1 + i % 7);
    return task;
}

template <class System>
[[nodiscard]] Task<System> pendulum(const System& system)
{
    return {.system = system, .x0 = {1, 0}, .t_end = 20};
}

}  // namespace ricochet::report
