#include "scene/roots.hpp"

#include <algorithm>

namespace ricochet::detail {

namespace {

/// Places at which a polynomial changes its sign, ascending.
struct Roots {
    std::array<double, largest_degree> at{};
    int count = 0;
    void add(double s) { at[static_cast<std::size_t>(count++)] = s; }
};

/// The root between a and b, where the values fa and fb have opposite signs: Newton's method from a
/// guess, or from where the secant ends, or halves where it leads outside.
double root_between(const Polynomial& c, int degree, double guess, double a, double fa, double b,
                    double fb)
{
    const double secant = a + (b - a) * (fa / (fa - fb));
    double s = guess > a && guess < b ? guess : secant > a && secant < b ? secant : 0.5 * (a + b);
    for (int i = 0; i < 200; ++i) {
        double f = c[static_cast<std::size_t>(degree)];
        double rate = 0;
        for (int k = degree - 1; k >= 0; --k) {
            rate = rate * s + f;
            f = f * s + c[static_cast<std::size_t>(k)];
        }
        if (f == 0) return s;
        ((f < 0) == (fa < 0) ? a : b) = s;
        double next = s - f / rate;
        if (!(next > a && next < b)) next = 0.5 * (a + b);
        if (next == s || next <= a || next >= b) return next;
        if (std::fabs(next - s) <= 2e-16 * std::fabs(next)) return next;
        s = next;
    }
    return s;
}

/// Whether the lowest coefficients prove that the slope has no root in (0, until].
bool is_monotone(const Polynomial& c, int degree, double until)
{
    double other = 0;
    for (int k = degree; k > 1; --k) {
        other = (other + k * std::fabs(c[static_cast<std::size_t>(k)])) * until;
    }
    return std::fabs(c[1]) > other;
}

/// All roots in (0, until], from those of the derivative, between which the polynomial is monotone.
/// `guess` may be near one of them.
Roots roots_in(const Polynomial& c, int degree, double until, double guess = never)
{
    Roots roots;
    while (degree > 0 && c[static_cast<std::size_t>(degree)] == 0) --degree;
    if (degree == 0) return roots;
    Roots turns;
    if (degree > 1 && !is_monotone(c, degree, until)) {
        Polynomial slope{};
        for (int k = 1; k <= degree; ++k) {
            slope[static_cast<std::size_t>(k - 1)] = k * c[static_cast<std::size_t>(k)];
        }
        turns = roots_in(slope, degree - 1, until);
    }
    double from = 0;
    double f_from = c[0];
    for (int k = 0; k <= turns.count; ++k) {
        const double to = k < turns.count ? turns.at[static_cast<std::size_t>(k)] : until;
        const double f_to = value_of(c, degree, to);
        if ((f_from > 0 && f_to <= 0) || (f_from < 0 && f_to >= 0)) {
            roots.add(f_to == 0 ? to : root_between(c, degree, guess, from, f_from, to, f_to));
        }
        from = to;
        f_from = f_to;
    }
    return roots;
}

/// A bound below which all roots lie (Lagrange; Fujiwara).
double bound_of_roots(const Polynomial& c, int degree)
{
    double bound = 0;
    const double lead = std::fabs(c[static_cast<std::size_t>(degree)]);
    for (int k = 0; k < degree; ++k) {
        const double ratio = std::fabs(c[static_cast<std::size_t>(k)]) / lead;
        if (ratio > 0) bound = std::max(bound, std::pow(ratio, 1.0 / (degree - k)));
    }
    return 2 * bound;
}

}  // namespace

double falls_within(Polynomial c, int degree, double until, double tolerance) noexcept
{
    while (degree > 0 && c[static_cast<std::size_t>(degree)] == 0) --degree;
    if (c[0] <= tolerance) {
        // The gap is closed now: the next coefficient decides, and the root at zero is divided out.
        int first = 1;
        while (first <= degree && c[static_cast<std::size_t>(first)] == 0) ++first;
        if (first > degree) return never;
        if (c[static_cast<std::size_t>(first)] < 0) return 0;
        for (int k = first; k <= degree; ++k) {
            c[static_cast<std::size_t>(k - first)] = c[static_cast<std::size_t>(k)];
        }
        degree -= first;
    }
    if (degree == 0) return never;
    const double end = std::isfinite(until) ? until : bound_of_roots(c, degree);
    const Roots roots = roots_in(c, degree, end, falls_after(c[0], c[1], 2 * c[2], 0));
    if (roots.count > 0) return roots.at[0];
    return never;
}

std::array<double, largest_degree> falls_in(const Polynomial& c, int degree, double until) noexcept
{
    std::array<double, largest_degree> falls;
    falls.fill(never);
    while (degree > 0 && c[static_cast<std::size_t>(degree)] == 0) --degree;
    if (degree == 0) return falls;
    const double end = std::isfinite(until) ? until : bound_of_roots(c, degree);
    const Roots roots = roots_in(c, degree, end);
    int count = 0;
    for (int r = 0; r < roots.count; ++r) {
        const double s = roots.at[static_cast<std::size_t>(r)];
        double rate = 0;
        for (int k = degree; k > 0; --k) rate = rate * s + k * c[static_cast<std::size_t>(k)];
        if (rate < 0) falls[static_cast<std::size_t>(count++)] = s;
    }
    return falls;
}

double falls_again(const Polynomial& c, int degree, double until) noexcept
{
    while (degree > 0 && c[static_cast<std::size_t>(degree)] == 0) --degree;
    if (degree < 2) return never;
    const double end = std::isfinite(until) ? until : bound_of_roots(c, degree);
    const Roots roots = roots_in(c, degree, end);
    if (roots.count > 1) return roots.at[1];
    return never;
}

}  // namespace ricochet::detail
