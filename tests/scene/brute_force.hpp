// Discs in the unit square by brute force, as an oracle.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ricochet/scene/scene.hpp"

namespace ricochet::test {

/// All pairs and walls at every collision, in long double.
class BruteForce {
public:
    explicit BruteForce(const Scene& scene)
    {
        for (const Disc& d : scene.bodies()) {
            discs_.push_back({d.at[0], d.at[1], d.velocity[0], d.velocity[1], d.radius, d.mass});
        }
    }
    long double next()
    {
        long double first = std::numeric_limits<long double>::infinity();
        std::size_t a = 0;
        std::size_t b = 0;
        int wall = -1;
        for (std::size_t i = 0; i < discs_.size(); ++i) {
            const D& d = discs_[i];
            const std::array<long double, 4> times{
                d.v < 0 ? (d.r - d.y) / d.v : -1, d.u < 0 ? (d.r - d.x) / d.u : -1,
                d.v > 0 ? (1 - d.r - d.y) / d.v : -1, d.u > 0 ? (1 - d.r - d.x) / d.u : -1};
            for (int w = 0; w < 4; ++w) {
                const long double t = times[static_cast<std::size_t>(w)];
                if (t >= 0 && t < first) first = t, a = i, wall = w;
            }
            for (std::size_t j = 0; j < i; ++j) {
                const long double t = meeting(d, discs_[j]);
                if (t < first) first = t, a = i, b = j, wall = -1;
            }
        }
        for (D& d : discs_) d.x += first * d.u, d.y += first * d.v;
        if (wall >= 0) {
            (wall % 2 == 0 ? discs_[a].v : discs_[a].u) *= -1;
        } else {
            strike(discs_[a], discs_[b]);
        }
        return t_ += first;
    }

private:
    struct D {
        long double x, y, u, v, r, m;
    };
    static long double meeting(const D& a, const D& b)
    {
        const long double x = a.x - b.x, y = a.y - b.y, u = a.u - b.u, v = a.v - b.v;
        const long double rate = x * u + y * v, reach = a.r + b.r;
        const long double square = rate * rate - (u * u + v * v) * (x * x + y * y - reach * reach);
        if (rate >= 0 || square < 0) return std::numeric_limits<long double>::infinity();
        return (x * x + y * y - reach * reach) / (std::sqrt(square) - rate);
    }
    static void strike(D& a, D& b)
    {
        const long double x = a.x - b.x, y = a.y - b.y, square = x * x + y * y;
        const long double p =
            2 * ((a.u - b.u) * x + (a.v - b.v) * y) / square / (1 / a.m + 1 / b.m);
        a.u -= p * x / a.m, a.v -= p * y / a.m;
        b.u += p * x / b.m, b.v += p * y / b.m;
    }
    std::vector<D> discs_;
    long double t_ = 0;
};

}  // namespace ricochet::test
