// Friction of any law or learned pair along a history of slip rate.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/faults/friction.hpp"
#include "ricochet/faults/variational_step.hpp"

namespace ricochet {

/// Friction along a history that starts in the state xi. The state is integrated by the
/// L-stable method of order 4, in `steps` equal steps between samples.
/// @throws std::invalid_argument for a history that `validate` refuses, or steps < 1.
template <EliminableLaw Law>
[[nodiscard]] std::vector<double> friction_along(const Law& law, const FrictionHistory& history,
                                                 double xi, int steps = 16)
{
    validate(history);
    detail::require_step(steps);
    const detail::SdirkTable& table = detail::sdirk_table(4);
    std::vector<double> out;
    for (std::size_t n = 0; n < history.t.size(); ++n) {
        for (int part = 0; n > 0 && part < steps; ++part) {
            const double v0 = history.v[n - 1];
            const bool linear = history.between == FrictionHistory::Between::linear;
            const double change = linear ? history.v[n] - v0 : 0;
            const double h = (history.t[n] - history.t[n - 1]) / steps;
            std::array<double, 5> rate{};
            double stage = xi;
            for (std::size_t i = 0; i < table.stages; ++i) {
                double before = xi;
                for (std::size_t j = 0; j < i; ++j) before += h * table.a[i][j] * rate[j];
                const double v = v0 + change * (part + table.c[i]) / steps;
                stage = detail::implicit_state(law, table.gamma * h, v, before, stage);
                rate[i] = (stage - before) / (table.gamma * h);
            }
            xi = stage;
        }
        out.push_back(law.gradient(history.v[n], xi).friction);
    }
    return out;
}

}  // namespace ricochet
