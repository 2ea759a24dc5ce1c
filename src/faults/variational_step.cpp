#include "ricochet/faults/variational_step.hpp"

#include <fmt/format.h>

#include <numbers>
#include <stdexcept>

#include "base/require.hpp"

namespace ricochet::detail {

namespace {

constexpr double g2 = 1 - 1 / std::numbers::sqrt2;

constexpr SdirkTable backward_euler{.stages = 1, .gamma = 1, .a = {}, .c = {1}, .error = {}};

constexpr SdirkTable second{
    .stages = 2, .gamma = g2, .a = {{{}, {1 - g2}}}, .c = {g2, 1}, .error = {-g2, g2}};

constexpr SdirkTable fourth{
    .stages = 5,
    .gamma = 0.25,
    .a = {{{},
           {1.0 / 2},
           {17.0 / 50, -1.0 / 25},
           {371.0 / 1360, -137.0 / 2720, 15.0 / 544},
           {25.0 / 24, -49.0 / 48, 125.0 / 16, -85.0 / 12}}},
    .c = {1.0 / 4, 3.0 / 4, 11.0 / 20, 1.0 / 2, 1},
    .error = {25.0 / 24 - 59.0 / 48, -49.0 / 48 + 17.0 / 96, 125.0 / 16 - 225.0 / 32, 0, 1.0 / 4}};

}  // namespace

const SdirkTable& sdirk_table(int order)
{
    if (order == 1) return backward_euler;
    if (order == 2) return second;
    if (order == 4) return fourth;
    throw std::invalid_argument(
        fmt::format("variational step: the order must be 1, 2 or 4, got {}", order));
}

void require_step(double h)
{
    if (h > 0 && std::isfinite(h)) return;
    throw std::invalid_argument(
        fmt::format("variational step: the step must be positive and finite, got {} s", h));
}

}  // namespace ricochet::detail
