// Guards that move faster than the state: for the tests and the measurements.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "ricochet/integrate.hpp"

namespace ricochet::test {

/// Up to three sines of time over a state that stands still or turns slowly.
struct RandomGuard {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    static constexpr double end = 20;  ///< [s]

    std::array<double, 3> amplitude{};
    std::array<double, 3> frequency{};  ///< [rad/s]
    std::array<double, 3> phase{};
    double offset = 0;
    double slope = 0;  ///< [1/s]
    double slow = 0;   ///< [rad/s] of the state
    State start{};

    explicit RandomGuard(std::uint32_t seed)
    {
        std::mt19937 random(seed);
        const auto uniform = [&](double a, double b) {
            return std::uniform_real_distribution<double>(a, b)(random);
        };
        if (random() % 2) slow = uniform(1e-3, 0.05);
        const std::size_t sines = 1 + random() % 3;
        for (std::size_t i = 0; i < sines; ++i) {
            amplitude[i] = uniform(0.1, 1);
            frequency[i] = std::exp(uniform(0, 4));
            phase[i] = uniform(0, 6.3);
        }
        offset = uniform(-0.5, 0.5);
        if (random() % 2) slope = uniform(-0.02, 0.02);
        start = {uniform(-0.3, 0.3), uniform(-0.3, 0.3)};
    }

    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = Crossing::either}; }
    void flow(double, const State& x, State& dxdt) const { dxdt = {slow * x[1], -slow * x[0]}; }
    [[nodiscard]] double guard(double t, const State& x) const
    {
        double sum = offset + slope * t + x[0];
        for (std::size_t i = 0; i < 3; ++i)
            sum += amplitude[i] * std::sin(frequency[i] * t + phase[i]);
        return sum;
    }
    [[nodiscard]] double exact(double t) const
    {
        return guard(t, {start[0] * std::cos(slow * t) + start[1] * std::sin(slow * t), 0});
    }

    /// All sign changes [s], from 300 samples in every period of the fastest sine.
    [[nodiscard]] std::vector<double> roots() const
    {
        double fastest = 1;
        for (std::size_t i = 0; i < 3; ++i) {
            if (amplitude[i] > 0) fastest = std::max(fastest, frequency[i]);
        }
        const auto samples = static_cast<int>(end * fastest * 50);
        std::vector<double> found;
        double before = exact(0);
        for (int i = 1; i <= samples; ++i) {
            const double after = exact(end * i / samples);
            if ((before > 0) != (after > 0)) {
                double lo = end * (i - 1) / samples;
                double hi = end * i / samples;
                for (int k = 0; k < 60; ++k) {
                    const double middle = (lo + hi) / 2;
                    ((exact(middle) > 0) == (before > 0) ? lo : hi) = middle;
                }
                found.push_back((lo + hi) / 2);
            }
            before = after;
        }
        return found;
    }
};

/// Roots, and those that a run missed, with the widest dip missed as a fraction of its step.
struct Misses {
    std::size_t roots = 0;
    std::size_t missed = 0;
    double widest = 0;
};

[[nodiscard]] inline Misses misses_of(std::uint32_t seed, bool check_inside = true)
{
    const RandomGuard guard(seed);
    Options options{.t_end = RandomGuard::end};
    options.check_inside = check_inside;
    using Run = Simulation<RandomGuard, RandomGuard::State>;
    Run simulation(guard, guard.start, options);
    std::vector<double> nodes{0};
    simulation.run_to_end([&](const Run& at) { nodes.push_back(at.t()); });
    const auto run = simulation.finish();
    const std::vector<double> exact = guard.roots();
    Misses misses{.roots = exact.size()};
    for (std::size_t i = 0; i < exact.size(); ++i) {
        const bool found =
            std::any_of(run.events.begin(), run.events.end(),
                        [&](const auto& event) { return std::fabs(event.t - exact[i]) < 1e-6; });
        if (found) continue;
        ++misses.missed;
        double width = RandomGuard::end;
        if (i > 0) width = std::min(width, exact[i] - exact[i - 1]);
        if (i + 1 < exact.size()) width = std::min(width, exact[i + 1] - exact[i]);
        const auto after = std::lower_bound(nodes.begin() + 1, nodes.end() - 1, exact[i]);
        misses.widest = std::max(misses.widest, width / (*after - *(after - 1)));
    }
    return misses;
}

/// A spiral into the origin, on which guards have no fixed scale. The third component counts
/// events.
struct Spiral {
    using State = std::array<double, 3>;
    enum Kind { product, component, cube };
    Kind kind = product;
    double decay = 0.5;  ///< [1/s]
    static constexpr State start{1, 0.3, 0};

    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = Crossing::either}; }
    void flow(double, const State& x, State& dxdt) const
    {
        dxdt = {x[1] - decay * x[0], -x[0] - decay * x[1], 0};
    }
    [[nodiscard]] double guard(double, const State& x) const
    {
        return kind == product ? x[0] * x[1] : kind == component ? x[0] : x[0] * x[0] * x[0];
    }
    void reset(double, State& x) const { x[2] += 1; }

    /// Crossings until time t: x0 is cos(t - phi) times a factor, and x1 is -sin.
    [[nodiscard]] double crossings(double t) const
    {
        constexpr double pi = 3.141592653589793;
        const double phi = std::atan2(start[1], start[0]);
        return kind == product ? std::floor((t - phi) / (pi / 2)) + 1
                               : std::floor((t - phi) / pi + 0.5);
    }
};

/// Motion that ends at its surface, beyond which the flow is not a number.
struct Draining {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;
    enum Kind { root, torricelli, logarithm };
    Kind kind = root;

    void flow(double, const State& x, State& dxdt) const
    {
        dxdt[0] = kind == root         ? -1 - std::sqrt(x[0])
                  : kind == torricelli ? -std::sqrt(x[0])
                                       : -1 / (1 - std::log(x[0]));
    }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }

    /// Time when the level is 0 after 1 at the start [s]: the integral of 1 / |x'| from 0 to 1.
    [[nodiscard]] double empty() const { return kind == root ? 2 * (1 - std::log(2.0)) : 2; }
};

}  // namespace ricochet::test
