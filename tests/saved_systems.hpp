// Systems whose runs are saved, or cannot continue: for the tests and the measurements.
#pragma once

#include <array>
#include <random>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "ricochet/integrate.hpp"

namespace ricochet::test {

/// A bouncing ball with restitution 0.8.
struct Ball {
    using State = std::array<double, 2>;
    bool unilateral = true;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x = {0, -0.8 * x[1]}; }
};

/// The same system as another type.
struct Droplet : Ball {};

/// A snapshot of the ball nine steps after its start from 1 m at rest.
[[nodiscard]] inline Snapshot saved_ball(const Options& options)
{
    const Ball ball;
    Simulation<Ball, Ball::State> simulation(ball, Ball::State{1, 0}, options);
    for (int i = 0; i < 9; ++i) simulation.step();
    return simulation.save();
}

/// The reaction of a run with these choices to a snapshot; "accepted" if there is no refusal.
template <class System, class Stepping = ErrorControlled<Dopri5>, class... Choices>
[[nodiscard]] std::string refused_by(const Snapshot& snapshot, const System& system,
                                     const Options& asked, const Stepping& stepping = {},
                                     const Choices&... choices)
{
    Simulation<System, Ball::State, Stepping, Choices...> simulation(system, Ball::State{1, 0},
                                                                     asked, stepping, choices...);
    return refusal([&] { simulation.restore(snapshot); });
}

/// A ball whose functions can be made to lose a component of the state.
struct Losing {
    using State = std::vector<double>;
    enum Where { nowhere, in_flow, in_late_flow, in_reset, in_rest, in_time_reset, to_nothing };
    Where where = nowhere;

    void flow(double t, const State& x, State& dxdt) const
    {
        dxdt = {x[1], -9.81};
        if (where == in_flow || (where == in_late_flow && t > 0.2)) dxdt.pop_back();
    }
    /// Throws std::out_of_range where a shortened state is used.
    [[nodiscard]] double guard(double, const State& x) const { return x.at(0) + 0 * x.at(1); }
    void reset(double, State& x) const
    {
        x = {0, -0.5 * x.at(1)};
        if (where == in_reset) x.pop_back();
        if (where == to_nothing) x.clear();
    }
    void rest(double, State& x) const
    {
        x = {0, 0};
        if (where == in_rest) x.pop_back();
    }
    [[nodiscard]] double next_time_event(double t) const { return t < 0.1 ? 0.1 : 1e9; }
    void time_reset(double, State& x) const
    {
        if (where == in_time_reset) x.pop_back();
    }
};

/// x' = 1 without an end: a guard that turns x back every `period`.
struct Sawtooth {
    using State = std::array<double, 1>;
    double period = 1e-16;  // [s]
    void flow(double, const State&, State& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const State& x) const { return period - x[0]; }
    void reset(double, State& x) const { x[0] = 0; }
};

/// A text with a character replaced or inserted, some erased, or its end cut off.
[[nodiscard]] inline std::string changed(std::string text, std::mt19937_64& random)
{
    const std::size_t at = random() % text.size();
    switch (random() % 4) {
        case 0: text[at] = static_cast<char>(random() % 256); break;
        case 1: text.erase(at, 1 + random() % 20); break;
        case 2: text.insert(at, 1, static_cast<char>('0' + random() % 10)); break;
        default: text.resize(at);
    }
    return text;
}

}  // namespace ricochet::test
