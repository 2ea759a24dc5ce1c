#include "ricochet/faults/friction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace ricochet {

namespace {

void require_drive(double d)
{
    if (d <= 0) return;
    throw std::invalid_argument(
        fmt::format("state-dependent potential: d = -b s is never positive, got {}", d));
}

[[noreturn]] void refuse_rate(double rate, double xi)
{
    throw std::invalid_argument(fmt::format(
        "state-dependent potential: at xi = {} no slip rate of the convex range gives xi' = {} 1/s",
        xi, rate));
}

/// log(Omega) >= -1 with Omega log(Omega) = q >= -1/e.
double log_omega_of(double q)
{
    // Solves m e^m = q. The start has an error below 0.3 (in m); Newton's method from above, in
    // m, of a function that is convex there descends to the solution.
    const double gap = 1 + q * std::exp(1.0);
    if (gap <= 0) return -1;
    double m = q < 1 ? -1 + std::sqrt(2 * gap) : std::log1p(q);
    for (int i = 0; i < 60; ++i) {
        const double step = (m - q * std::exp(-m)) / (1 + m);
        m -= step;
        if (std::abs(step) <= 4e-16 * (1 + std::abs(m))) break;
    }
    return m;
}

}  // namespace

template <StateEvolution evolution, DirectEffect effect>
requires(evolution != StateEvolution::ageing) ScalarJet
    StateDependentPotential<evolution, effect>::dual(double d, double xi)
const
{
    require_drive(d);
    const RateStateParameters& p = law_.parameters();
    const double s = -d / p.b;
    if constexpr (evolution == StateEvolution::slip) {
        if (s == 0) return {};
        const double log_omega = std::log(s / p.v_star) + xi;
        return {p.b / (2 * p.d_rs) * s * s * (log_omega - 0.5), -(s / p.d_rs) * log_omega,
                (log_omega + 1) / (p.b * p.d_rs)};
    } else {
        const double heal = p.v_star * std::exp(-xi);  // [m/s]
        const double l = p.d_rs;
        return {-p.b / l * s * (heal - s * s / (12 * heal)), (heal - s * s / (4 * heal)) / l,
                s / (2 * p.b * l * heal)};
    }
}

template <StateEvolution evolution, DirectEffect effect>
requires(evolution != StateEvolution::ageing) ScalarJet
    StateDependentPotential<evolution, effect>::primal(double rate, double xi)
const
{
    const RateStateParameters& p = law_.parameters();
    const double heal = p.v_star * std::exp(-xi);
    double s = 0;
    if constexpr (evolution == StateEvolution::slip) {
        const double q = -rate * p.d_rs / heal;
        // The largest rate has q = -1/e; the excess by the rounding of log(Omega) and xi is
        // allowed.
        if (!(q >= -std::exp(-1.0) * (1 + 1e-14 * (1 + std::abs(xi))))) refuse_rate(rate, xi);
        s = heal * std::exp(log_omega_of(q));
    } else {
        const double square = 4 * heal * (heal - p.d_rs * rate);
        if (!(square >= -1e-14 * heal * heal)) refuse_rate(rate, xi);
        s = std::sqrt(std::max(square, 0.0));
    }
    const double d = -p.b * s;
    const ScalarJet of_d = dual(d, xi);
    return {d * rate - of_d.value, d, 1 / of_d.second};
}

template class StateDependentPotential<StateEvolution::slip, DirectEffect::log>;
template class StateDependentPotential<StateEvolution::slip, DirectEffect::asinh>;
template class StateDependentPotential<StateEvolution::prz, DirectEffect::log>;
template class StateDependentPotential<StateEvolution::prz, DirectEffect::asinh>;

}  // namespace ricochet
