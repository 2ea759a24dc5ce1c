// Accuracy with which the potentials of rate-and-state friction satisfy their identities, against
// independent formulas in arithmetic of 113 bits.
#pragma once

#include <algorithm>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <random>

#include "ricochet/faults/incremental.hpp"

namespace ricochet::test {

using Quad = boost::multiprecision::cpp_bin_float_quad;

/// The laws by their definitions, in a different form from the library's.
struct QuadLaw {
    RateStateParameters p;
    StateEvolution evolution;
    DirectEffect effect;

    [[nodiscard]] Quad w(const Quad& xi) const
    {
        return 2 * Quad(p.v_star) * exp(-(Quad(p.f_star) + Quad(p.b) * xi) / Quad(p.a));
    }
    [[nodiscard]] Quad friction(const Quad& v, const Quad& xi) const
    {
        if (effect == DirectEffect::log) {
            return Quad(p.f_star) + Quad(p.a) * log(v / Quad(p.v_star)) + Quad(p.b) * xi;
        }
        // The logarithm loses the digits of a small z; the series omits z^10.
        const Quad z = abs(v) / w(xi);
        const Quad y = z * z;
        const Quad asinh =
            z < Quad("1e-3")
                ? Quad(z * (1 - y / 6 * (1 - y * 9 / 20 * (1 - y * 25 / 42 * (1 - y * 49 / 72)))))
                : log(z + sqrt(y + 1));
        const Quad f = Quad(p.a) * asinh;
        return v < 0 ? Quad(-f) : f;
    }
    /// s, without the loss of sqrt(V^2 + w^2) - w.
    [[nodiscard]] Quad speed(const Quad& v, const Quad& xi) const
    {
        if (effect == DirectEffect::log) return v;
        const Quad u = w(xi);
        return v * v / (sqrt(v * v + u * u) + u);
    }
    /// The two terms whose difference is xi' D_RS.
    [[nodiscard]] Quad healing(const Quad& v, const Quad& xi) const
    {
        return evolution == StateEvolution::slip
                   ? Quad(-log(speed(v, xi) / Quad(p.v_star)) - xi) * speed(v, xi)
                   : Quad(p.v_star) * exp(-xi);
    }
    [[nodiscard]] Quad wear(const Quad& v, const Quad& xi) const
    {
        const Quad s = speed(v, xi);
        if (evolution == StateEvolution::ageing) return s;
        if (evolution == StateEvolution::slip) return 0;
        return s * s * exp(xi) / (4 * Quad(p.v_star));
    }
    /// Ddag, with the integral of the asinh as V asinh(V/w) - V^2 / (sqrt(V^2 + w^2) + w).
    [[nodiscard]] Quad rate_potential(const Quad& v, const Quad& xi) const
    {
        const Quad heal = evolution == StateEvolution::ageing
                              ? Quad(Quad(p.b) * Quad(p.v_star) * exp(-xi))
                              : Quad(0);
        if (effect == DirectEffect::log) {
            return Quad(p.f_star) * v + Quad(p.a) * v * (log(v / Quad(p.v_star)) - 1) +
                   Quad(p.b) * xi * v + heal;
        }
        return v * friction(v, xi) - Quad(p.a) * speed(v, xi) + heal;
    }
};

/// Largest relative errors over random points.
struct IdentityErrors {
    double friction = 0;     ///< (5), against the law
    double balance = 0;      ///< (6)
    double transform = 0;    ///< (8)
    double rate = 0;         ///< (9), against the law
    double gradient = 0;     ///< of Ddag, against differences of its value
    double hessian = 0;      ///< of Ddag, likewise
    double dual_slopes = 0;  ///< of D*, likewise, and D'' D*'' = 1
    double step = 0;         ///< the gradient of J against (16)
    [[nodiscard]] double worst() const
    {
        return std::max({friction, balance, transform, rate, gradient, hessian, dual_slopes, step});
    }
};

namespace identities {

inline void note(double& worst, const Quad& found, const Quad& expected, const Quad& scale)
{
    const double error = static_cast<double>(abs(found - expected) / scale);
    worst = std::isnan(error) ? 1e300 : std::max(worst, error);
}

/// Steps of 1e-8: truncation 1e-16 and rounding 1e-34 / 1e-16 of the second differences.
template <class Function>
void compare_jet(const RateStateJet& jet, const Function& value, double v, double xi,
                 IdentityErrors& e)
{
    const Quad h("1e-8");
    const Quad dv = h * abs(Quad(v));
    const auto at = [&](int i, int j) { return value(Quad(v) + i * dv, Quad(xi) + j * h); };
    const Quad centre = at(0, 0), right = at(1, 0), left = at(-1, 0), up = at(0, 1),
               down = at(0, -1);
    const Quad s = abs(Quad(v));
    // A derivative that cancels is assessed relative to a fraction of the value.
    const Quad unit = abs(centre) * Quad("1e-3");
    const auto scale = [&](const Quad& derivative, const Quad& per) {
        return std::max<Quad>(abs(derivative), unit / per);
    };
    const Quad by_v = (right - left) / (2 * dv);
    const Quad by_xi = (up - down) / (2 * h);
    note(e.gradient, jet.v, by_v, scale(by_v, s));
    note(e.gradient, jet.xi, by_xi, scale(by_xi, 1));
    const Quad vv = (right - 2 * centre + left) / (dv * dv);
    const Quad xixi = (up - 2 * centre + down) / (h * h);
    const Quad vxi = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * dv * h);
    note(e.hessian, jet.vv, vv, scale(vv, s * s));
    note(e.hessian, jet.vxi, vxi, scale(vxi, s));
    note(e.hessian, jet.xixi, xixi, scale(xixi, 1));
    note(e.gradient, jet.value, centre, abs(centre));
}

template <class Pair>
void compare_dual(const Pair& pair, double d, double xi, IdentityErrors& e)
{
    const ScalarJet dual = pair.dual(d, xi);
    if (!(dual.second > 0)) return;  // D is the transform of the convex range alone
    const double rate = dual.first;
    // Where D* is flat, a rounding of the rate moves d by much more.
    if (!(dual.second * std::abs(d) > 0.1 * std::abs(rate))) return;
    const ScalarJet primal = pair.primal(rate, xi);
    const Quad product = Quad(d) * Quad(rate);
    note(e.transform, Quad(dual.value), product - Quad(primal.value),
         abs(product) + abs(Quad(primal.value)));
    note(e.dual_slopes, Quad(primal.first), Quad(d), abs(Quad(d)));
    note(e.dual_slopes, Quad(primal.second) * Quad(dual.second), 1, 1);
}

}  // namespace identities

/// V/V* in [1e-12, 1e4], of both signs with the asinh form, xi in [-10, 30].
template <class Pair>
[[nodiscard]] IdentityErrors check_identities(const Pair& pair, const QuadLaw& law, int points,
                                              unsigned seed)
{
    using identities::note;
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> log_v(std::log(1e-12), std::log(1e4));
    std::uniform_real_distribution<double> state(-10, 30);
    std::uniform_real_distribution<double> unit(0, 1);
    const RateStateParameters& p = law.p;
    IdentityErrors e;
    for (int i = 0; i < points; ++i) {
        double v = p.v_star * std::exp(log_v(random));
        const double xi = state(random);
        if (law.effect == DirectEffect::asinh && unit(random) < 0.3) v = -v;

        const RateStateJet jet = pair.rate_potential(v, xi);
        note(e.friction, jet.v, law.friction(v, xi), abs(law.friction(v, xi)));
        identities::compare_jet(
            jet, [&](const Quad& a, const Quad& b) { return law.rate_potential(a, b); }, v, xi, e);

        const double d = -jet.xi;
        const Quad heal = law.healing(v, xi);
        const Quad wear = law.wear(v, xi);
        // Relative to the larger side: the rate itself vanishes at steady sliding. The slip
        // law's is a product with log(Omega), in which the logarithm and xi cancel.
        const Quad scale =
            law.evolution == StateEvolution::slip
                ? Quad((abs(Quad(xi)) + abs(log(law.speed(v, xi) / Quad(p.v_star)))) *
                       law.speed(v, xi))
                : std::max<Quad>(heal, wear);
        note(e.rate, Quad(pair.dual(d, xi).first) * Quad(p.d_rs), heal - wear, scale);
        if (Pair::kind == PotentialKind::quadratic) {
            const Quad rate = (heal - wear) / Quad(p.d_rs);
            const ScalarJet primal = pair.primal(static_cast<double>(rate), xi);
            note(e.balance, Quad(primal.first) + Quad(jet.xi), 0, Quad(p.b) * scale);
        }
        identities::compare_dual(pair, d, xi, e);

        if (Pair::kind != PotentialKind::quadratic) continue;
        // (16): the step's equations, written out in quadruple precision.
        const SpringBlock block{.mass = 1, .stiffness = 1e4, .normal_force = 9.81};
        const double h = 1e-3;
        const double x = v * h;
        const IncrementalStart start{
            .x = 0, .x_before = -0.7 * x, .xi = xi - 1e-3 * unit(random), .load = 1e-4, .h = h};
        const double slip_rate = (x - start.x) / h;
        const IncrementalJet j = incremental_potential(pair, block, start, x, xi);
        const Quad inertia = (Quad(x) - 2 * Quad(start.x) + Quad(start.x_before)) / (Quad(h) * h);
        const Quad spring = Quad(block.stiffness) * (Quad(start.load) - Quad(x));
        const Quad grip = Quad(block.normal_force) * law.friction(slip_rate, xi);
        note(e.step, j.x, inertia - spring + grip, abs(inertia) + abs(spring) + abs(grip));
        const Quad push = Quad(p.b) * Quad(p.d_rs) * (Quad(xi) - Quad(start.xi)) / Quad(h);
        const Quad pull = Quad(p.b) * (law.healing(slip_rate, xi) - law.wear(slip_rate, xi));
        note(e.step, Quad(j.xi) / (Quad(block.normal_force) * Quad(h)), push - pull,
             abs(push) + Quad(p.b) * scale);
    }
    return e;
}

}  // namespace ricochet::test
