#include "fault_kernel.hpp"

#include <cmath>
#include <numbers>

namespace ricochet {

namespace {

/// Sum over the four corners of a rectangle about (x, y), each with the product of its signs.
template <class Function>
double over_corners(double x, double y, double width, double height, Function&& term)
{
    double sum = 0;
    for (const double i : {1.0, -1.0}) {
        for (const double j : {1.0, -1.0}) {
            sum += i * j * term(x + i * width / 2, y + j * height / 2);
        }
    }
    return sum;
}

}  // namespace

double full_space_stress(double dx, double dz, double width, double height, double poisson) noexcept
{
    const double sum = over_corners(dx, dz, width, height, [poisson](double p, double q) {
        const double r = std::hypot(p, q);
        return q / (p * r * (1 - poisson)) + p / (q * r);
    });
    return -sum / (4 * std::numbers::pi);
}

// In Okada's notation, with q = 0 on the plane, d = eta and z = -depth: du_x/dy + du_y/dx of part
// A is alpha/2 xi (eta/R^3 + xi^2 Y32) + eta/2 X11, or -alpha eta/(R xi) - xi/(2 R eta) except for
// terms that cancel over the corners; this is the source itself. Its image has parts A and B, and
// z times part C, -2 alpha xi (1/R^3 + z Y32). Okada's slip has the opposite sign.
double half_space_stress(double dx, double depth, double source, double width, double height,
                         double poisson) noexcept
{
    const double alpha = 1 / (2 * (1 - poisson));  // (lambda + mu) / (lambda + 2 mu)
    const auto image = [alpha, depth](double xi, double eta) {
        const double r = std::hypot(xi, eta);
        const double above = 1 / (r + eta);
        const double a_and_b = (2 - alpha) * eta / (r * xi) + xi / (2 * r * eta) +
                               (1 - alpha) / alpha * xi * above * above;
        const double y32 = (2 * r + eta) * above * above / (r * r * r);
        return a_and_b + 2 * alpha * depth * xi * (1 / (r * r * r) - depth * y32);
    };
    const double sum = over_corners(dx, source + depth, width, height, image);
    return full_space_stress(dx, depth - source, width, height, poisson) -
           sum / (2 * std::numbers::pi);
}

}  // namespace ricochet
