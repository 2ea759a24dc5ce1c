#include "stiffness_series.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace ricochet {

namespace {

double at(const detail::Spectrum& interval, double x)
{
    return 0.5 * (interval.upper + interval.lower) + 0.5 * (interval.upper - interval.lower) * x;
}

/// An interval that has a width.
detail::Spectrum widened(detail::Spectrum interval)
{
    interval.upper = std::max(interval.upper, interval.lower * (1 + 1e-12));
    return interval;
}

/// Coefficients of the series of f, from its values at the zeros of a far higher polynomial.
std::vector<double> coefficients(const StiffnessSeries::Function& f,
                                 const detail::Spectrum& interval, int count)
{
    constexpr int samples = 1024;
    std::vector<double> cosine(4 * samples);
    for (int i = 0; i < 4 * samples; ++i) {
        cosine[static_cast<std::size_t>(i)] = std::cos(std::numbers::pi * i / (2 * samples));
    }
    std::vector<double> value(samples);
    for (std::size_t j = 0; j < samples; ++j) value[j] = f(at(interval, cosine[2 * j + 1]));
    std::vector<double> c(static_cast<std::size_t>(count));
    for (std::size_t k = 0; k < c.size(); ++k) {
        double sum = 0;
        for (std::size_t j = 0; j < samples; ++j) {
            sum += value[j] * cosine[k * (2 * j + 1) % (4 * samples)];
        }
        c[k] = (k == 0 ? 1.0 : 2.0) / samples * sum;
    }
    return c;
}

}  // namespace

StiffnessSeries::StiffnessSeries(const Function& f, detail::Spectrum interval, int degree)
    : interval_(widened(interval)), c_(coefficients(f, interval_, degree + 1))
{
}

namespace {

/// Values of T_0 .. T_degree at x.
Eigen::VectorXd chebyshev_values(double x, int degree)
{
    Eigen::VectorXd t(degree + 1);
    t[0] = 1;
    if (degree > 0) t[1] = x;
    for (int k = 2; k <= degree; ++k) t[k] = 2 * x * t[k - 1] - t[k - 2];
    return t;
}

/// Remez's exchange: the coefficients whose largest relative error is least, from a few rounds.
/// Empty where the points no longer alternate, as happens near rounding.
std::vector<double> of_least_error(const StiffnessSeries::Function& f,
                                   const detail::Spectrum& interval, int degree)
{
    constexpr int rounds = 6;
    const int unknowns = degree + 2;
    const int samples = 32 * unknowns;
    Eigen::MatrixXd basis(samples + 1, degree + 1);  // over f
    std::vector<double> grid;
    for (int j = 0; j <= samples; ++j) {
        grid.push_back(std::cos(std::numbers::pi * j / samples));
        basis.row(j) =
            chebyshev_values(grid.back(), degree).transpose() / f(at(interval, grid.back()));
    }
    std::vector<int> points;
    for (int i = 0; i < unknowns; ++i) points.push_back(i * samples / (unknowns - 1));
    Eigen::VectorXd solution;
    for (int round = 0; round < rounds; ++round) {
        Eigen::MatrixXd system(unknowns, unknowns);
        for (int i = 0; i < unknowns; ++i) {
            system.row(i).head(degree + 1) = basis.row(points[static_cast<std::size_t>(i)]);
            system(i, degree + 1) = i % 2 == 0 ? 1 : -1;
        }
        solution = system.partialPivLu().solve(Eigen::VectorXd::Ones(unknowns));
        const Eigen::VectorXd error = (basis * solution.head(degree + 1)).array() - 1;
        // The largest error between two changes of its sign.
        std::vector<int> extrema{0};
        for (int j = 1; j <= samples; ++j) {
            int& last = extrema.back();
            if (error[j] * error[last] < 0) {
                extrema.push_back(j);
            } else if (std::abs(error[j]) > std::abs(error[last])) {
                last = j;
            }
        }
        while (static_cast<int>(extrema.size()) > unknowns) {
            const bool first = std::abs(error[extrema.front()]) < std::abs(error[extrema.back()]);
            extrema.erase(first ? extrema.begin() : extrema.end() - 1);
        }
        if (static_cast<int>(extrema.size()) < unknowns) return {};
        points = std::move(extrema);
    }
    return {solution.data(), solution.data() + degree + 1};
}

}  // namespace

StiffnessSeries StiffnessSeries::within(const Function& f, detail::Spectrum interval, double bound)
{
    const StiffnessSeries all(f, interval, most_terms);
    StiffnessSeries some;
    some.interval_ = all.interval_;
    const auto meets = [&](int degree) {
        some.c_.assign(all.c_.begin(), all.c_.begin() + degree + 1);
        return some.relative_error(f) <= bound;
    };
    const auto meets_at_best = [&](int degree) {
        some.c_ = of_least_error(f, all.interval_, degree);
        return (!some.c_.empty() && some.relative_error(f) <= bound) || meets(degree);
    };
    // Errors fall with the degree: bisection between a degree that is too low and one that is
    // enough.
    int enough = 1;
    while (enough < most_terms && !meets(enough)) enough = std::min(2 * enough, most_terms);
    if (!meets(enough)) {
        throw std::invalid_argument(fmt::format(
            "a polynomial of degree {} in the stiffness is off by {:.3g}, relatively; the bound "
            "asked for, {:.3g}, cannot be met",
            enough, some.relative_error(f), bound));
    }
    int too_few = 0;
    while (enough - too_few > 1) {
        const int middle = (enough + too_few) / 2;
        (meets_at_best(middle) ? enough : too_few) = middle;
    }
    (void)meets_at_best(enough);
    return some;
}

void StiffnessSeries::combine(const StiffnessSeries& p, double constant, double slope,
                              double factor)
{
    interval_ = p.interval_;
    c_.resize(std::max<std::size_t>(p.c_.size(), 2));
    for (std::size_t k = 0; k < c_.size(); ++k) c_[k] = k < p.c_.size() ? factor * p.c_[k] : 0;
    c_[0] += constant + slope * 0.5 * (interval_.upper + interval_.lower);
    c_[1] += slope * 0.5 * (interval_.upper - interval_.lower);
}

double StiffnessSeries::operator()(double eigenvalue) const noexcept
{
    const double centre = 0.5 * (interval_.upper + interval_.lower);
    const double x = (eigenvalue - centre) / (0.5 * (interval_.upper - interval_.lower));
    double b1 = 0;
    double b2 = 0;
    for (std::size_t k = c_.size() - 1; k > 0; --k) {
        const double b0 = c_[k] + 2 * x * b1 - b2;
        b2 = b1;
        b1 = b0;
    }
    return c_[0] + x * b1 - b2;
}

double StiffnessSeries::relative_error(const Function& f) const
{
    const int samples = 64 * (degree() + 1);
    double largest = 0;
    for (int j = 0; j <= samples; ++j) {
        const double x = at(interval_, std::cos(std::numbers::pi * j / samples));
        const double error = std::abs((*this)(x) / f(x) - 1);
        if (!(error <= largest)) largest = error;
    }
    return largest;
}

void StiffnessSeries::apply(StiffnessProduct& product, const Eigen::VectorXd& x, Eigen::VectorXd& y,
                            Scratch& scratch) const
{
    const double half = 0.5 * (interval_.upper - interval_.lower);
    const double centre = 0.5 * (interval_.upper + interval_.lower) / half;
    const double slope = 1 / half;
    const Eigen::Index n = x.size();
    auto& [before, now, next] = scratch;
    for (Eigen::VectorXd* v : {&before, &now, &next}) v->resize(n);
    if (degree() == 0) {
        y = c_[0] * x;
        return;
    }
    product(x, now);
    for (Eigen::Index i = 0; i < n; ++i) {
        before[i] = x[i];
        now[i] = slope * now[i] - centre * x[i];
        y[i] = c_[0] * x[i] + c_[1] * now[i];
    }
    for (std::size_t k = 2; k < c_.size(); ++k) {
        product(now, next);
        const double c = c_[k];
        for (Eigen::Index i = 0; i < n; ++i) {
            const double value = 2 * (slope * next[i] - centre * now[i]) - before[i];
            before[i] = now[i];
            now[i] = value;
            y[i] += c * value;
        }
    }
}

}  // namespace ricochet
