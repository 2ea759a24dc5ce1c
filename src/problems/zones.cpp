#include "problems/zones.hpp"

#include <complex>
#include <memory>
#include <numbers>

#include "base/require.hpp"
#include "ricochet/base/detail/splitmix.hpp"

namespace ricochet {

namespace {

/// cos and sin of m (angle - turn t), where (x, y) = r (cos angle, sin angle).
std::complex<double> petal(int m, double turn, double t, double x, double y, double r)
{
    double re = 1;
    double im = 0;
    for (int k = 0; k < m; ++k) {
        const double next = (re * x - im * y) / r;
        im = (re * y + im * x) / r;
        re = next;
    }
    const double c = std::cos(m * turn * t);
    const double s = std::sin(m * turn * t);
    return {re * c + im * s, im * c - re * s};
}

}  // namespace

Zones::Zones(const Parameters& parameters) : size_(parameters.size)
{
    detail::require(parameters.count > 0, "Zones", "count", "be positive",
                    static_cast<double>(parameters.count));
    detail::require_positive("Zones", "size", parameters.size);
    detail::require_positive("Zones", "frequency", parameters.frequency);
    detail::require_not_negative("Zones", "turn", parameters.turn);
    stiffness_[0] = parameters.frequency * parameters.frequency;
    stiffness_[1] = stiffness_[0] * std::numbers::phi * std::numbers::phi;

    detail::SplitMix random(parameters.seed);
    std::vector<Zone> zones(parameters.count);
    // Sizes are chosen so that the zones cover a tenth of the field for any number of them.
    const double scale = size_ / std::sqrt(static_cast<double>(parameters.count));
    for (Zone& zone : zones) {
        zone.x = random.uniform(-size_, size_);
        zone.y = random.uniform(-size_, size_);
        zone.radius = scale * random.uniform(0.2, 0.5);
        zone.amplitude = random.uniform(0.1, 0.3);
        zone.petals = 3 + static_cast<int>(random.uniform(0, 5));
        zone.turn = parameters.turn * random.uniform(-1, 1);
        const double across = zone.amplitude * zone.petals;
        const double radial = 1 + 1.3 * zone.amplitude;
        zone.lipschitz = std::sqrt(radial * radial + across * across);
        zone.turning = 2 * zone.radius * across * std::fabs(zone.turn) / zone.lipschitz;
        zone.disc = zone.radius * (1 + 2 * zone.amplitude);
    }
    zones_ = std::make_shared<const std::vector<Zone>>(std::move(zones));
}

double Zones::value(const Zone& zone, double t, double x, double y) noexcept
{
    const double dx = x - zone.x;
    const double dy = y - zone.y;
    const double r = std::sqrt(dx * dx + dy * dy);
    if (r == 0) return -zone.radius;
    const double s = 2 * r * r / (r * r + zone.radius * zone.radius);
    const double wave = petal(zone.petals, zone.turn, t, dx, dy, r).real();
    return r - zone.radius * (1 + zone.amplitude * s * wave);
}

double Zones::rate(const Zone& zone, double t, const std::array<double, 4>& motion) noexcept
{
    const double dx = motion[0] - zone.x;
    const double dy = motion[1] - zone.y;
    const double r = std::sqrt(dx * dx + dy * dy);
    const double square = zone.radius * zone.radius;
    // In the centre, where there is no direction, the guard has a kink like r.
    if (r == 0) return std::hypot(motion[2], motion[3]);
    const double s = 2 * r * r / (r * r + square);
    const double ds = 4 * r * square / ((r * r + square) * (r * r + square));
    const std::complex<double> wave = petal(zone.petals, zone.turn, t, dx, dy, r);
    const double outward = (dx * motion[2] + dy * motion[3]) / r;
    const double turning = (dx * motion[3] - dy * motion[2]) / (r * r) - zone.turn;
    return outward - zone.radius * zone.amplitude *
                         (ds * outward * wave.real() - s * zone.petals * turning * wave.imag());
}

}  // namespace ricochet
