// Random networks as guards along random orbits, and whether a run finds every crossing of a fine
// reference. Used by a test, and in full by a measuring program.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "nn_models.hpp"
#include "ricochet/enclosed.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nn/guard_network.hpp"

namespace ricochet {

/// Two springs, of angular frequencies 1 and `frequency`, whose orbit is known; events of a network
/// of both positions are recorded.
struct NeuralOrbit {
    using State = std::array<double, 4>;
    static constexpr bool resets = false;

    GuardNetwork network;
    double frequency = 1.7;  ///< [rad/s]

    template <class S>
    void flow(const S&, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        const double stiffness = frequency * frequency;
        dxdt = {x[2], x[3], -x[0], -stiffness * x[1]};
    }
    template <class S>
    [[nodiscard]] S guard(const S&, const std::array<S, 4>& x) const
    {
        return network(x[0], x[1]);
    }
    [[nodiscard]] static GuardInfo guard_info() { return {.crossing = Crossing::either}; }

    /// The positions at time t [s].
    [[nodiscard]] std::array<double, 2> place(const State& start, double t) const
    {
        return {
            start[0] * std::cos(t) + start[2] * std::sin(t),
            start[1] * std::cos(frequency * t) + start[3] / frequency * std::sin(frequency * t)};
    }
};

struct NeuralOrbitCounts {
    std::uint64_t orbits = 0, crossings = 0, found = 0, lost = 0;
    EvidenceCounts evidence;

    void add(const NeuralOrbitCounts& other) noexcept
    {
        orbits += other.orbits;
        crossings += other.crossings;
        found += other.found;
        lost += other.lost;
        evidence.proved += other.evidence.proved;
        evidence.checked += other.evidence.checked;
        evidence.gated += other.evidence.gated;
        evidence.assumed += other.evidence.assumed;
    }
};

inline constexpr double neural_orbit_time = 6;  // [s]
inline constexpr int neural_orbit_samples = 24'000;

/// A network of random weights, three times as large as those with which training starts, whose
/// level is such that one of its minima on a random orbit is a dip of 1e-5 to 0.1: most steps that
/// hold such a dip have both ends on the same side.
[[nodiscard]] inline NeuralOrbit random_neural_orbit(std::uint64_t seed, NeuralOrbit::State& start)
{
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    constexpr std::array kinds{Activation::relu, Activation::tanh, Activation::silu};
    Model model = random_model({2, 16, 16, 1}, kinds[seed % kinds.size()], seed);
    for (double& weight : model.layers[0].weight) weight *= 3;
    start = {uniform(random), uniform(random), uniform(random), 1.5 * uniform(random)};
    NeuralOrbit orbit{GuardNetwork(model), 1.2 + std::fabs(uniform(random))};
    std::vector<double> minima;
    constexpr double interval = neural_orbit_time / 1500;  // [s]
    double before = orbit.network(orbit.place(start, 0)), here = before;
    for (int k = 1; k < 1500; ++k) {
        const double after = orbit.network(orbit.place(start, k * interval));
        if (here < before && here < after) minima.push_back(here);
        before = here;
        here = after;
    }
    const double least = minima.empty() ? here : minima[seed / 3 % minima.size()];
    model.layers.back().bias[0] -= least + std::pow(10.0, -3 + 2 * uniform(random));
    orbit.network = GuardNetwork(model);
    return orbit;
}

/// Times [s] of the crossings between samples of the network on the known orbit. A dip of less than
/// 1e-6 is left out: the orbits of a run and of the reference differ by up to 1e-8, and the
/// gradients are below 100.
[[nodiscard]] inline std::vector<double> reference_crossings(const NeuralOrbit& orbit,
                                                             const NeuralOrbit::State& start)
{
    constexpr double interval = neural_orbit_time / neural_orbit_samples;  // [s]
    std::vector<double> times;
    double last = orbit.network(orbit.place(start, 0));
    double deepest = std::fabs(last);  // since the last crossing
    double pending = -1;  // [s] of a crossing that may yet be followed by a dip too small to count
    for (int k = 1; k <= neural_orbit_samples; ++k) {
        const double t = k * interval;
        const double g = orbit.network(orbit.place(start, t));
        if ((g > 0) != (last > 0)) {
            if (pending >= 0 && deepest >= 1e-6) times.push_back(pending);
            pending = deepest >= 1e-6 ? t - 0.5 * interval : -1;
            deepest = 0;
        }
        deepest = std::max(deepest, std::fabs(g));
        last = g;
    }
    if (pending >= 0 && deepest >= 1e-6) times.push_back(pending);
    return times;
}

/// Crossings of the reference within two of whose intervals a run has no event.
template <class Stepping, class Detector>
[[nodiscard]] NeuralOrbitCounts count_lost(const NeuralOrbit& orbit,
                                           const NeuralOrbit::State& start,
                                           const std::vector<double>& reference,
                                           const Stepping& stepping, const Detector& detector,
                                           Options options)
{
    options.t_end = neural_orbit_time;
    const auto run = integrate(orbit, start, options, stepping, detector);
    NeuralOrbitCounts counts;
    counts.orbits = 1;
    counts.crossings = reference.size();
    counts.found = run.events.size();
    counts.evidence = run.statistics.evidence;
    constexpr double reach = 2 * neural_orbit_time / neural_orbit_samples;
    std::size_t near = 0;
    for (const double t : reference) {
        while (near < run.events.size() && run.events[near].t < t - reach) ++near;
        counts.lost += near == run.events.size() || run.events[near].t > t + reach;
    }
    return counts;
}

}  // namespace ricochet
