#include "ricochet/faults/detail/wright_omega.hpp"

#include <array>
#include <cmath>

namespace ricochet {

namespace {

/// A polynomial in t = (z - centre) / half; relative error below 2.5e-6 for |t| <= 1.
struct Segment {
    double centre, inverse_half;
    std::array<double, 7> c;
};

constexpr Segment low{
    -0.75,
    1 / 1.25,
    {0.33717022532458746, 0.3151902020328427, 0.11015554804998282, 0.008347831359413563,
     -0.0044841101240752634, -0.00042879917534111717, 0.00029606740538104526}};
constexpr Segment middle{
    2,
    1 / 1.5,
    {1.5571460142567446, 0.9134129435312454, 0.10475703621428302, -0.016975653571957284,
     0.0014420599505213056, 0.0004350086975929166, -0.00022384086146935885}};
constexpr Segment high{
    6.75,
    1 / 3.25,
    {5.1173600360102505, 2.718713669917424, 0.1180770717235481, -0.031463321177990396,
     0.008634304723967649, -0.002535743950181274, 0.0006370221795294687}};

double value(const Segment& s, double z) noexcept
{
    const double t = (z - s.centre) * s.inverse_half;
    const double q = t * t;
    const double even = s.c[0] + q * (s.c[2] + q * (s.c[4] + q * s.c[6]));
    return even + t * (s.c[1] + q * (s.c[3] + q * s.c[5]));
}

/// The start for z > -1.5, within 2.5e-5.
double start(double z) noexcept
{
    if (z < 0.5) return value(low, z);
    if (z < 3.5) return value(middle, z);
    if (z < 10) return value(high, z);
    // The asymptotic series (Corless and Jeffrey) to the third power of log(z)/z.
    const double l = std::log(z);
    const double i = 1 / z;
    return z - l + l * i * (1 + i * (0.5 * (l - 2) + i * (l * l / 3 - 1.5 * l + 1)));
}

/// omega(z) = W(x), x = e^z, for x < 0.2236: x times a polynomial, within 6.5e-18 of W(x).
double by_exponential(double z) noexcept
{
    constexpr std::array c{
        -0.999999999999983,  1.4999999999926539, -2.6666666654071025, 5.208333219173919,
        -10.799993691704827, 23.34282434875287,  -52.00676486860325,  118.51463177919943,
        -274.0380279604796,  633.6365629564965,  -1420.8060312945424, 2926.735137675986,
        -5123.63705970087,   6884.02852277586,   -6123.1181067845055, 2648.5674784475027};
    const double x = std::exp(z);
    const double q = x * x;
    double odd = c[14];
    double even = c[15];
    for (int i = 12; i >= 0; i -= 2) {
        odd = c[static_cast<std::size_t>(i)] + q * odd;
        even = c[static_cast<std::size_t>(i) + 1] + q * even;
    }
    return x + x * (x * (odd + x * even));  // the leading 1 is exact
}

}  // namespace

double wright_omega(double z) noexcept
{
    if (z < -1.5) return by_exponential(z);
    if (!(z < 1e300)) return z;  // also NaN
    const double u = start(z);
    // u (1 + t) is the solution where (1 + u) t - t^2/2 + t^3/3 - ... = r; t <= 2.5e-5, so
    // that three terms of the inverse series leave 1e-18.
    const double log_u = std::log(u);
    const double r = z < 0.5 ? (z - log_u) - u : (z - u) - log_u;  // the two of similar size first
    const double i = 1 / (1 + u);
    const double p = r * i;
    const double c = 0.5 * i;
    return u + u * (p + p * p * (c + p * (c - 1.0 / 3) * i));
}

}  // namespace ricochet
