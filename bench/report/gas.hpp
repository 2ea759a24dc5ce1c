// A gas of elastic discs in the unit square: as a scene for ricochet, as one state with a guard for
// every pair for peers that solve ordinary differential equations, and by brute force in long
// double for the reference.
//
// Deviations grow about fivefold with every collision of a disc, so that only the times of the
// first 60 collisions of the gas are scored; the runs last for about one collision per disc.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "problems.hpp"
#include "ricochet/guard.hpp"
#include "scene/gas.hpp"

namespace ricochet::report {

inline constexpr std::size_t scored_collisions = 60;
inline constexpr std::size_t gas_sizes[] = {100, 1000, 10000};
/// Largest number of discs for peers that need one state: more have too many guards.
inline constexpr std::size_t gas_in_one_state = 100;

[[nodiscard]] inline std::string gas_title(std::size_t discs)
{
    return "Gas of " + std::to_string(discs) + " discs, the first 60 collisions";
}

[[nodiscard]] inline Scene gas_scene(std::size_t discs)
{
    return test::gas({.count = discs, .fraction = 0.3, .spread = 0.3});
}

/// [s] The rate of collisions of a disc grows with the root of their number.
[[nodiscard]] inline double gas_end(std::size_t discs)
{
    return 1 / std::sqrt(static_cast<double>(discs));
}

/// Sizes and steps [s] for engines of constant steps; none that take tens of seconds.
template <class Visit>
void for_each_gas_step(Visit visit)
{
    for (const std::size_t discs : gas_sizes) {
        for (const double parts : {1e2, 1e3, 1e4}) {
            if (parts * static_cast<double>(discs) <= 1e6) visit(discs, gas_end(discs) / parts);
        }
    }
}

/// Number of the guard between discs i and j, i < j.
[[nodiscard]] inline std::size_t pair_guard(std::size_t i, std::size_t j)
{
    return j * (j - 1) / 2 + i;
}

/// Number of the guard between disc i and a wall: 0 below, 1 left, 2 above, 3 right.
[[nodiscard]] inline std::size_t wall_guard(std::size_t discs, std::size_t i, std::size_t wall)
{
    return discs * (discs - 1) / 2 + 4 * i + wall;
}

/// The discs in one state: x, y, u, v of each.
struct DiscGas {
    using State = std::vector<double>;
    std::vector<double> radius{}, mass{};
    std::vector<std::pair<std::size_t, std::size_t>> pairs{};  ///< by number of guard

    explicit DiscGas(const Scene& scene)
    {
        for (const Disc& disc : scene.bodies()) {
            radius.push_back(disc.radius);
            mass.push_back(disc.mass);
        }
        for (std::size_t j = 1; j < radius.size(); ++j) {
            for (std::size_t i = 0; i < j; ++i) pairs.emplace_back(i, j);
        }
    }

    [[nodiscard]] std::size_t guard_count() const { return pairs.size() + 4 * radius.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.unilateral = true, .degree = which < pairs.size() ? 2 : 1};
    }
    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const
    {
        for (std::size_t i = 0; i < radius.size(); ++i) {
            dxdt[4 * i] = x[4 * i + 2];
            dxdt[4 * i + 1] = x[4 * i + 3];
            dxdt[4 * i + 2] = dxdt[4 * i + 3] = 0;
        }
    }
    /// The square of the distance over that of contact, or the distance to a wall.
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const X& x) const
    {
        if (which < pairs.size()) {
            const auto [i, j] = pairs[which];
            const double dx = x[4 * i] - x[4 * j];
            const double dy = x[4 * i + 1] - x[4 * j + 1];
            const double reach = radius[i] + radius[j];
            return dx * dx + dy * dy - reach * reach;
        }
        const auto [i, wall] = wall_of(which);
        const double at = x[4 * i + (wall % 2 == 0 ? 1 : 0)];
        return (wall < 2 ? at : 1 - at) - radius[i];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double /*t*/, const X& x,
                                    const D& dxdt) const
    {
        if (which < pairs.size()) {
            const auto [i, j] = pairs[which];
            return 2 * ((x[4 * i] - x[4 * j]) * (dxdt[4 * i] - dxdt[4 * j]) +
                        (x[4 * i + 1] - x[4 * j + 1]) * (dxdt[4 * i + 1] - dxdt[4 * j + 1]));
        }
        const auto [i, wall] = wall_of(which);
        const double rate = dxdt[4 * i + (wall % 2 == 0 ? 1 : 0)];
        return wall < 2 ? rate : -rate;
    }
    template <class X>
    void reset(std::size_t which, double /*t*/, X& x) const
    {
        if (which < pairs.size()) {
            strike(pairs[which].first, pairs[which].second, x);
        } else {
            const auto [i, wall] = wall_of(which);
            x[4 * i + (wall % 2 == 0 ? 3 : 2)] *= -1;
        }
    }
    /// Kinetic energy [J].
    template <class X>
    [[nodiscard]] double energy(const X& x) const
    {
        double sum = 0;
        for (std::size_t i = 0; i < radius.size(); ++i) {
            sum += mass[i] / 2 * (x[4 * i + 2] * x[4 * i + 2] + x[4 * i + 3] * x[4 * i + 3]);
        }
        return sum;
    }

private:
    [[nodiscard]] std::pair<std::size_t, std::size_t> wall_of(std::size_t which) const
    {
        const std::size_t k = which - pairs.size();
        return {k / 4, k % 4};
    }
    template <class X>
    void strike(std::size_t i, std::size_t j, X& x) const
    {
        const double dx = x[4 * i] - x[4 * j];
        const double dy = x[4 * i + 1] - x[4 * j + 1];
        const double approach =
            (x[4 * i + 2] - x[4 * j + 2]) * dx + (x[4 * i + 3] - x[4 * j + 3]) * dy;
        const double p = 2 * approach / (dx * dx + dy * dy) / (1 / mass[i] + 1 / mass[j]);
        x[4 * i + 2] -= p * dx / mass[i];
        x[4 * i + 3] -= p * dy / mass[i];
        x[4 * j + 2] += p * dx / mass[j];
        x[4 * j + 3] += p * dy / mass[j];
    }
};

/// The first collisions of a gas, and when they are over.
struct FirstCollisions {
    std::vector<Expected> events;
    double until = 0;  ///< [s] halfway between the last of them and the next
};

/// Computes the first collisions in long double, with all pairs and walls; the predictions of a
/// disc are renewed when it is hit.
[[nodiscard]] FirstCollisions first_collisions(const Scene& scene, std::size_t count);

/// The gas as one state.
[[nodiscard]] Task<DiscGas> gas(std::size_t discs);

}  // namespace ricochet::report
