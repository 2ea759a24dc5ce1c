// Systems for the tests of hosts, and their runs.
//
// A `Maker` sets up an integrator: `Maker::Of<System> made(system, mode, x0, {rtol, atol})` has it
// as `made.host()`, with the flow of the system in the mode that `mode` says.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "ricochet/hosts/detail/run.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::hosts_test {

struct Tolerances {
    double rtol = 1e-10;
    double atol = 1e-13;
};

/// The flow of a system in the form of a callback of C.
template <class System>
struct FlowOf {
    const System* system;
    const Mode* mode;

    void operator()(double t, const double* x, double* dxdt, std::size_t n) const
    {
        typename System::State at{};
        if constexpr (requires { at.resize(n); }) at.resize(n);
        std::copy_n(x, n, at.begin());
        auto rate = at;
        if constexpr (requires { system->flow(*mode, t, at, rate); }) {
            system->flow(*mode, t, at, rate);
        } else {
            system->flow(t, at, rate);
        }
        std::copy_n(rate.begin(), n, dxdt);
    }
};

// --- systems ---

/// A mass of 1 kg on a belt of 0.2 m/s, held by a spring of 1 N/m and by friction, 1 N while it
/// sticks, 0.5 N while it slips.
struct StickSlip {
    using State = std::array<double, 2>;  ///< position [m], velocity [m/s]
    enum : Mode { sticks, slips };
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 2;
    static constexpr double belt = 0.2;
    static constexpr double holding = 1;
    static constexpr double sliding = 0.5;

    void flow(Mode mode, double /*t*/, const State& x, State& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = mode == sticks ? 0 : sliding - x[0];
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, Mode /*mode*/, double /*t*/, const X& x) const
    {
        return which == sticks ? holding - x[0] : belt - x[1];
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const { return which == mode; }
    [[nodiscard]] Mode reset(std::size_t which, Mode /*mode*/, double /*t*/, State& x) const
    {
        x[1] = belt;
        return which == sticks ? slips : sticks;
    }

    /// Time of event k = 0, 1, ... from (0, belt), sticking [s]. It sticks from 0 to `holding`, and
    /// slips from (a, belt) to (-a, belt) around the point where spring and friction balance,
    /// clockwise by pi + 2 atan(belt / a), a = holding - sliding; when it sticks again it is at 0.
    [[nodiscard]] static double event_time(int k)
    {
        const double held = holding / belt;
        const double slipping = std::numbers::pi + 2 * std::atan(belt / (holding - sliding));
        const int sticks_before = 1 + k / 2;
        const int slips_before = (k + 1) / 2;
        return held * sticks_before + slipping * slips_before;
    }
};

struct TwoBalls {
    using State = std::array<double, 4>;
    static constexpr std::size_t guard_count = 2;
    BouncingBall ball;

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        dxdt = {x[1], -ball.gravity(), x[3], -ball.gravity()};
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const X& x) const
    {
        return x[2 * which];
    }
    void reset(std::size_t which, double /*t*/, State& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= -ball.restitution();
    }
};

/// sin t, and a surface that lies by `depth` below its crests.
struct Crests {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::either;
    double depth;

    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {x[1], -x[0]}; }
    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const
    {
        return (1 - depth) - x[0];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return -dxdt[0];
    }
};

/// x = (t, sin 5 t, cos 5 t), so that steps are short. The guard is zero until 1, on one side until
/// 3, then on the other.
struct Plateau {
    using State = std::array<double, 3>;
    static constexpr bool resets = false;
    double sign;

    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {1, 5 * x[2], -5 * x[1]}; }
    [[nodiscard]] double guard(double /*t*/, const State& x) const
    {
        return sign * std::fmax(0, x[0] - 1) * (3 - x[0]);
    }
};

/// x' = -x, with an increase of one every second.
struct Dosed {
    using State = std::array<double, 1>;

    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt[0] = -x[0]; }
    [[nodiscard]] double next_time_event(double t) const { return std::floor(t) + 1; }
    void time_reset(double /*t*/, State& x) const { x[0] += 1; }
};

/// A body between two walls, whose distance from them changes no faster than it moves; and sin 5 t
/// beside it, so that steps are short.
struct Corridor {
    using State = std::array<double, 4>;
    static constexpr bool unilateral = true;
    mutable long calls = 0;

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        dxdt = {x[1], 0, 5 * x[3], -5 * x[2]};
    }
    [[nodiscard]] double guard(double /*t*/, const State& x) const
    {
        ++calls;
        return 10 - std::fabs(x[0]);
    }
    void reset(double /*t*/, State& x) const { x[1] = -x[1]; }
    [[nodiscard]] double lipschitz() const { return 1; }
    [[nodiscard]] double speed_bound(double /*t*/, const State& x) const { return std::fabs(x[1]); }
    [[nodiscard]] double acceleration_bound(double /*t*/, const State& /*x*/) const { return 0; }
};

// --- runs ---

template <class System>
struct Result {
    using State = typename System::State;
    Verdict verdict{};
    std::vector<Cut<State>> cuts;
    std::vector<Event<State>> events;
    State end{};
    double t = 0;

    [[nodiscard]] std::vector<double> event_times() const
    {
        std::vector<double> times;
        for (const auto& event : events) times.push_back(event.t);
        return times;
    }
};

template <class Maker, class Detector = Extremum, class System>
Result<System> run(const System& system, const typename System::State& x0, double t_end,
                   const Tolerances& tolerances = {}, Mode mode = 0)
{
    typename Maker::template Of<System> made(system, mode, x0, tolerances);
    EventMonitor monitor(system, x0, {}, Detector{});
    Result<System> result;
    const auto at_cut = [&](const auto& cut) {
        mode = cut.mode_after;
        result.cuts.push_back(cut);
    };
    result.verdict = hosts::run(made.host(), monitor, t_end, at_cut, mode);
    result.events.assign(monitor.events().begin(), monitor.events().end());
    result.t = made.host().t();
    std::ranges::copy(made.host().x(), result.end.begin());
    return result;
}

}  // namespace ricochet::hosts_test
