#include "ricochet/faults/friction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <cmath>

#include "base/fast_tanh.hpp"
#include "base/require.hpp"

namespace ricochet {

namespace {

constexpr std::size_t width = MonotoneNet::most_units;

void require_rising(const MonotoneNet& net, std::string_view name)
{
    const std::string who = fmt::format("AdditivePair: net '{}'", name);
    const detail::Refuse refuse{who};
    if (net.units > width) refuse(fmt::format("at most {} units, found {}", width, net.units));
    if (!(net.slope >= 0 && std::isfinite(net.slope) && std::isfinite(net.offset))) {
        refuse(fmt::format("the slope must be zero or positive, found {}", net.slope));
    }
    for (std::size_t i = 0; i < net.units; ++i) {
        const double product = net.weight[i] * net.scale[i];
        if (!std::isfinite(product + net.shift[i])) refuse(fmt::format("unit {} is not finite", i));
        if (product < 0) {
            refuse(fmt::format("a convex potential needs weight x scale >= 0, found {} in unit {}",
                               product, i));
        }
    }
    if (!(net.slope > 0)) {
        for (std::size_t i = 0; i < net.units; ++i) {
            if (net.weight[i] * net.scale[i] > 0) return;
        }
        refuse("a constant, which is no monotone function");
    }
}

/// Value and slope of the sum over units from their tanh.
struct Sum {
    double value = 0, slope = 0;
};

Sum sum_of(const MonotoneNet& net, const double* t)
{
    Sum s{0, net.slope};
    for (std::size_t i = 0; i < width; ++i) {
        s.value += net.weight[i] * t[i];
        s.slope += net.weight[i] * net.scale[i] * (1 - t[i] * t[i]);
    }
    return s;
}

void arguments(const MonotoneNet& net, double z, double* out)
{
    for (std::size_t i = 0; i < width; ++i) out[i] = net.scale[i] * z + net.shift[i];
}

/// log(cosh(z)) without overflow.
double log_cosh(double z)
{
    const double a = std::abs(z);
    return a + std::log1p(std::exp(-2 * a)) - std::log(2.0);
}

template <class Function>
double integral_of_pair(const Function& f, double from, double to)
{
    if (std::isnan(to)) return to;
    return boost::math::quadrature::gauss_kronrod<double, 31>::integrate(f, from, to, 10, 1e-13);
}

}  // namespace

ScalarJet MonotoneNet::jet(double z) const noexcept
{
    ScalarJet out{offset + slope * z, slope, 0};
    for (std::size_t i = 0; i < units; ++i) {
        const double t = std::tanh(scale[i] * z + shift[i]);
        const double rise = weight[i] * scale[i] * (1 - t * t);
        out.value += weight[i] * t;
        out.first += rise;
        out.second -= 2 * t * scale[i] * rise;
    }
    return out;
}

AdditivePair::AdditivePair(const Parameters& parameters) : p_(parameters)
{
    detail::require_positive("AdditivePair", "V*", p_.v_star);
    detail::require_positive("AdditivePair", "beta", p_.beta);
    require_rising(p_.direct, "direct");
    require_rising(p_.state, "state");
    require_rising(p_.rate, "rate");
    p_.rate.offset = 0;
    for (MonotoneNet* net : {&p_.direct, &p_.state, &p_.rate}) {
        for (std::size_t i = net->units; i < width; ++i) {
            net->weight[i] = net->scale[i] = net->shift[i] = 0;
        }
    }
    rate_at_zero_ = p_.rate.jet(0).value;
}

std::size_t AdditivePair::fitted() const noexcept
{
    return p_.direct.parameters() + p_.state.parameters() + p_.rate.parameters() - 1;
}

FrictionAndRateGradient AdditivePair::gradient(double v, double xi) const
{
    if (!(v > 0)) detail::refuse_slip_rate(v);
    const double u = v / p_.v_star;
    const double y = std::log(u);
    std::array<double, 2 * width> first;
    arguments(p_.direct, y, first.data());
    arguments(p_.state, xi, first.data() + width);
    detail::tanh_all(first);
    const Sum a = sum_of(p_.direct, first.data());
    const Sum s = sum_of(p_.state, first.data() + width);
    const double heal = std::exp(-(p_.state.offset + p_.state.slope * xi + s.value));
    const double d = heal - u;
    std::array<double, width> second;
    arguments(p_.rate, d, second.data());
    detail::tanh_all(second);
    const Sum g = sum_of(p_.rate, second.data());
    return {p_.direct.offset + p_.direct.slope * y + a.value + p_.beta * xi,
            a.slope / v,
            p_.beta,
            p_.rate.slope * d + g.value - rate_at_zero_,
            -g.slope / p_.v_star,
            -g.slope * heal * s.slope};
}

FrictionAndRate AdditivePair::evaluate(double v, double xi) const
{
    const FrictionAndRateGradient g = gradient(v, xi);
    return {g.friction, g.rate};
}

RateStateJet AdditivePair::rate_potential(double v, double xi) const
{
    if (!(v > 0)) detail::refuse_slip_rate(v);
    const double y = std::log(v / p_.v_star);
    const ScalarJet a = p_.direct.jet(y);
    const ScalarJet c = p_.state.jet(xi);
    const double heal = std::exp(-c.value);
    // The integral_of_pair of A dV over (0, V) is V times that of A(y - s) e^-s ds.
    const double direct =
        v * integral_of_pair([&](double s) { return p_.direct.jet(y - s).value * std::exp(-s); },
                             0.0, 60.0);
    const double stored =
        integral_of_pair([&](double z) { return -std::exp(-p_.state.jet(z).value); }, 0.0, xi);
    const double unit = p_.beta * p_.v_star;
    return {direct + p_.beta * v * xi + unit * stored,
            a.value + p_.beta * xi,
            p_.beta * v - unit * heal,
            a.first / v,
            p_.beta,
            unit * heal * c.first};
}

ScalarJet AdditivePair::dual(double d, double /*xi*/) const
{
    const double unit = p_.beta * p_.v_star;
    const double z = d / unit;
    const MonotoneNet& g = p_.rate;
    const ScalarJet jet = g.jet(z);
    double value = g.slope * z * z / 2 - rate_at_zero_ * z;
    for (std::size_t i = 0; i < g.units; ++i) {
        if (g.scale[i] == 0) {
            value += g.weight[i] * std::tanh(g.shift[i]) * z;
            continue;
        }
        value += g.weight[i] / g.scale[i] *
                 (log_cosh(g.scale[i] * z + g.shift[i]) - log_cosh(g.shift[i]));
    }
    return {unit * value, jet.value - rate_at_zero_, jet.first / unit};
}

ScalarJet AdditivePair::primal(double rate, double /*xi*/) const
{
    // The root of a rising function, by Newton's method between ends of opposite signs.
    const double unit = p_.beta * p_.v_star;
    const auto gap = [&](double d) { return dual(d).first - rate; };
    double lower = -unit;
    double upper = unit;
    for (int i = 0; i < 200 && gap(lower) > 0; ++i) lower *= 2;
    for (int i = 0; i < 200 && gap(upper) < 0; ++i) upper *= 2;
    if (!(gap(lower) <= 0 && gap(upper) >= 0)) {
        throw std::invalid_argument(fmt::format("AdditivePair: no d gives the rate {} 1/s", rate));
    }
    double d = 0;
    for (int i = 0; i < 200; ++i) {
        const ScalarJet at = dual(d);
        (at.first > rate ? upper : lower) = d;
        const double next = d - (at.first - rate) / at.second;
        const double to = next > lower && next < upper ? next : (lower + upper) / 2;
        const bool done = std::abs(to - d) <= 1e-15 * (std::abs(d) + 1e-15 * unit);
        d = to;
        if (done) break;
    }
    const ScalarJet at = dual(d);
    return {d * rate - at.value, d, 1 / at.second};
}

}  // namespace ricochet
