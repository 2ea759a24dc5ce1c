// Discs at random in a box.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <vector>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::test {

struct Gas {
    std::size_t count = 10;
    double fraction = 0.3;  ///< fraction of the unit square that they cover
    double restitution = 1;
    Vector2 gravity{};
    double spread = 0;  ///< of radii and masses about their mean, as a fraction
    unsigned seed = 1;
};

/// The same discs for any `order` in which they are added: `order[k]` is the k-th.
inline Scene gas(const Gas& wanted, const std::vector<std::size_t>& order = {})
{
    const std::size_t columns =
        static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(wanted.count))));
    const double pitch = 1.0 / static_cast<double>(columns);
    const double radius =
        std::sqrt(wanted.fraction / (static_cast<double>(wanted.count) * std::numbers::pi));
    std::mt19937 generator(wanted.seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Scene scene({.gravity = wanted.gravity});
    const MaterialId material = scene.material({.restitution = wanted.restitution});
    for (const Vector2& normal : {Vector2{0, 1}, Vector2{1, 0}, Vector2{0, -1}, Vector2{-1, 0}}) {
        const Vector2 corner{normal[0] < 0 ? 1.0 : 0.0, normal[1] < 0 ? 1.0 : 0.0};
        scene.wall({.point = corner, .normal = normal, .material = material});
    }
    std::vector<Disc> discs(wanted.count);
    for (std::size_t i = 0; i < wanted.count; ++i) {
        Disc& disc = discs[i];
        disc.radius = radius * (1 + wanted.spread * uniform(generator));
        disc.mass = 1 + wanted.spread * uniform(generator);
        const double play = pitch / 2 - disc.radius;
        const std::size_t column = i % columns, row = i / columns;
        disc.at = {(static_cast<double>(column) + 0.5) * pitch + play * uniform(generator),
                   (static_cast<double>(row) + 0.5) * pitch + play * uniform(generator)};
        disc.velocity = {uniform(generator), uniform(generator)};
        disc.material = material;
    }
    for (std::size_t k = 0; k < wanted.count; ++k) scene.disc(discs[order.empty() ? k : order[k]]);
    return scene;
}

inline std::vector<BodyState> start_of(const Scene& scene)
{
    std::vector<BodyState> states;
    for (const Disc& disc : scene.bodies()) states.push_back({disc.at, disc.velocity});
    return states;
}

/// The largest overlap of two discs, or of a disc with the box.
inline double overlap(const Scene& scene, const std::vector<BodyState>& states)
{
    double largest = -1;
    for (std::size_t i = 0; i < states.size(); ++i) {
        const double r = scene.bodies()[i].radius;
        for (const double x : states[i].at) largest = std::max({largest, r - x, x + r - 1});
        for (std::size_t j = 0; j < i; ++j) {
            largest = std::max(largest, r + scene.bodies()[j].radius -
                                            std::hypot(states[i].at[0] - states[j].at[0],
                                                       states[i].at[1] - states[j].at[1]));
        }
    }
    return largest;
}

}  // namespace ricochet::test
