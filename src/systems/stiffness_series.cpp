#include "ricochet/systems/stiffness_series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace ricochet {

namespace {

double at(const Spectrum& interval, double x)
{
    return 0.5 * (interval.upper + interval.lower) + 0.5 * (interval.upper - interval.lower) * x;
}

/// An interval that has a width.
Spectrum widened(Spectrum interval)
{
    interval.upper = std::max(interval.upper, interval.lower * (1 + 1e-12));
    return interval;
}

/// Coefficients of f's series, from its values at the zeros of a far higher polynomial.
std::vector<double> coefficients(const StiffnessSeries::Function& f, const Spectrum& interval,
                                 int count)
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

StiffnessSeries::StiffnessSeries(const Function& f, Spectrum interval, int degree)
    : interval_(widened(interval)), c_(coefficients(f, interval_, degree + 1))
{
}

StiffnessSeries StiffnessSeries::within(const Function& f, Spectrum interval, double bound)
{
    StiffnessSeries all(f, interval, most_terms);
    StiffnessSeries some;
    some.interval_ = all.interval_;
    // Errors fall with the degree: bisection between what is too few and what is enough.
    const auto error_of = [&](int degree) {
        some.c_.assign(all.c_.begin(), all.c_.begin() + degree + 1);
        return some.relative_error(f);
    };
    int enough = 1;
    while (enough < most_terms && !(error_of(enough) <= bound)) {
        enough = std::min(2 * enough, most_terms);
    }
    const double reached = error_of(enough);
    if (!(reached <= bound)) {
        throw std::invalid_argument(fmt::format(
            "a polynomial of degree {} in the stiffness is off by {:.3g}, relatively; the bound "
            "asked for, {:.3g}, cannot be met",
            enough, reached, bound));
    }
    int too_few = enough == 1 ? 0 : enough / 2;
    while (enough - too_few > 1) {
        const int middle = (enough + too_few) / 2;
        (error_of(middle) <= bound ? enough : too_few) = middle;
    }
    (void)error_of(enough);
    return some;
}

StiffnessSeries StiffnessSeries::combined(double constant, double slope, double factor) const
{
    StiffnessSeries out = *this;
    for (double& c : out.c_) c *= factor;
    if (out.c_.size() < 2) out.c_.resize(2);
    out.c_[0] += constant + slope * 0.5 * (interval_.upper + interval_.lower);
    out.c_[1] += slope * 0.5 * (interval_.upper - interval_.lower);
    return out;
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
