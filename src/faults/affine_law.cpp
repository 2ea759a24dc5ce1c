#include "ricochet/faults/affine_law.hpp"

#include <fmt/format.h>

#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <cmath>
#include <utility>

#include "base/require.hpp"

namespace ricochet {

namespace {

template <class Function>
double integral_of_law(const Function& f, double from, double to)
{
    if (from == to) return 0;
    if (std::isnan(to)) return to;
    // With more halvings, parts do not get below the rounding of such a small error.
    constexpr unsigned halvings = 5;
    return boost::math::quadrature::gauss_kronrod<double, 21>::integrate(f, from, to, halvings,
                                                                         1e-14);
}

constexpr detail::Refuse refuse_law{"AffineLawPotential"};

}  // namespace

AffineLawPotential::AffineLawPotential(AffineLaw law) : law_(std::move(law))
{
    if (!law_.direct || !law_.direct_slope || !law_.state || !law_.state_slope || !law_.heal ||
        !law_.wear) {
        refuse_law("all six functions of the law are needed");
    }
    if (!(law_.theta_min > 0 && law_.theta_max > law_.theta_min)) {
        refuse_law(fmt::format("expected 0 < theta_min < theta_max, got {} and {}", law_.theta_min,
                               law_.theta_max));
    }
    constexpr int samples = 64;
    for (int i = 0; i <= samples; ++i) {
        (void)slope(law_.theta_min *
                    std::pow(law_.theta_max / law_.theta_min, i / (1.0 * samples)));
    }
    xi_max_ = xi_of_theta(law_.theta_max);
}

double AffineLawPotential::slope(double theta) const
{
    const double rise = law_.state_slope(theta);
    const double wear = law_.wear(theta);
    if (!(rise > 0))
        refuse_law(fmt::format("dB/dtheta must be positive, found {} at {}", rise, theta));
    if (!(wear > 0))
        refuse_law(fmt::format("q must be positive, found {} at theta = {}", wear, theta));
    return std::sqrt(rise / wear);
}

double AffineLawPotential::xi_of_theta(double theta) const
{
    if (!(theta >= law_.theta_min && theta <= law_.theta_max)) {
        refuse_law(fmt::format("theta must lie in [{}, {}], got {}", law_.theta_min, law_.theta_max,
                               theta));
    }
    return integral_of_law([&](double x) { return slope(std::exp(x)) * std::exp(x); },
                           std::log(law_.theta_min), std::log(theta));
}

double AffineLawPotential::theta_of_xi(double xi) const
{
    if (!(xi >= 0 && xi <= xi_max_)) {
        refuse_law(fmt::format("xi must lie in [0, {}], got {}", xi_max_, xi));
    }
    double lower = std::log(law_.theta_min);
    double upper = std::log(law_.theta_max);
    double x = lower + (upper - lower) * (xi / xi_max_);
    for (int i = 0; i < 100; ++i) {
        const double gap = xi_of_theta(std::exp(x)) - xi;
        (gap > 0 ? upper : lower) = x;
        const double step = gap / (slope(std::exp(x)) * std::exp(x));
        const double next = x - step;
        if (std::abs(step) <= 1e-15 * (1 + std::abs(x))) break;
        x = next > lower && next < upper ? next : (lower + upper) / 2;
    }
    return std::exp(x);
}

RateStateJet AffineLawPotential::rate_potential(double v, double xi) const
{
    const double theta = theta_of_xi(xi);
    const double g = slope(theta);  // dxi/dtheta
    const double c = integral_of_law(
        [&](double x) {
            const double at = std::exp(x);
            const double s = slope(at);
            return -law_.heal(at) * s * s * at;
        },
        std::log(law_.theta_min), std::log(theta));
    const double rise = law_.state_slope(theta);
    // d/dxi of  B' V / g - p g, by a central difference in log(theta).
    const auto by_xi = [&](double at) {
        const double s = slope(at);
        return law_.state_slope(at) * v / s - law_.heal(at) * s;
    };
    constexpr double h = 1e-5;
    const double curvature =
        (by_xi(theta * std::exp(h)) - by_xi(theta * std::exp(-h))) / (2 * h * theta * g);
    return {integral_of_law(law_.direct, law_.v_reference, v) + law_.state(theta) * v + c,
            law_.direct(v) + law_.state(theta),
            rise * v / g - law_.heal(theta) * g,
            law_.direct_slope(v),
            rise / g,
            curvature};
}

}  // namespace ricochet
