// A user of the component `learn_steps`: the least of a parabola.
#include <array>
#include <cmath>
#include <cstdio>
#include <span>

#include "ricochet/learn_steps/policies.hpp"

int main()
{
    const auto parabola = [](std::span<const double> x) { return (x[0] - 3) * (x[0] - 3); };
    const auto found = ricochet::learn::evolve(parabola, std::array{0.0}, {.target = 1e-8});
    const bool fine = std::fabs(found.x[0] - 3) < 1e-3;
    std::puts(fine ? "fine" : "not found");
    return fine ? 0 : 1;
}
