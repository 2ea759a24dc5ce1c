#include "ricochet/detail/series_guard.hpp"

#include <array>
#include <limits>

namespace ricochet::detail {

namespace {

constexpr int most_degree = 20;
/// A part of 2^-10 of a step is a parabola to the last bit: it is not halved further.
constexpr double smallest_part = 0x1p-10;
using Coefficients = std::array<double, most_degree + 1>;

/// 1 / C(n, k)
inline constexpr auto inverse_binomials = [] {
    std::array<Coefficients, most_degree + 1> out{};
    for (std::size_t n = 0; n <= most_degree; ++n) {
        double binomial = 1;
        for (std::size_t k = 0; k <= n; ++k) {
            out[n][k] = 1 / binomial;
            binomial = binomial * static_cast<double>(n - k) / static_cast<double>(k + 1);
        }
    }
    return out;
}();

/// The degree of the series of a guard without trailing zeros; at least 1.
[[nodiscard]] int degree_of(const GuardSeries& guard) noexcept
{
    const SeriesTerms& terms = guard.terms;
    int degree = terms.order;
    while (degree > 1 &&
           terms.coefficients[static_cast<std::size_t>(degree) * terms.stride + guard.which] == 0) {
        --degree;
    }
    return degree;
}

class SeriesSearch {
public:
    /// Keeps a reference to the guard.
    SeriesSearch(const GuardSeries& guard, int degree) noexcept
        : guard_(guard), degree_(degree), h_(guard.h), touch_(guard.touch)
    {
    }

    /// Takes the difference from the values at both ends as an error estimate.
    void blur(const Coefficients& c, double start, double end) noexcept
    {
        error_ += 2 * std::max(std::fabs(c[0] - start), std::fabs(c[at(degree_)] - end));
    }

    /// Whether there is a root at the start, where the coefficients begin with c[0].
    [[nodiscard]] bool starts_at_root(const Coefficients& c) const noexcept
    {
        return guard_.from_surface && std::fabs(c[0]) <= touch_ + 0x1p-44 * size_;
    }

    /// The coefficients in Bernstein form on [0, 1]; terms beyond the degree are counted as errors.
    void convert(Coefficients& c) noexcept
    {
        const SeriesTerms& terms = guard_.terms;
        const Coefficients& inverse = inverse_binomials[at(degree_)];
        double power = guard_.sign;
        double size = 0;
        double tail = 0;
        for (int k = 0; k <= terms.order; ++k) {
            const double q = power * terms.coefficients[at(k) * terms.stride + guard_.which];
            size += std::fabs(q);
            if (k <= degree_) {
                c[at(k)] = q * inverse[at(k)];
            } else {
                tail += std::fabs(q);
            }
            power *= h_;
        }
        for (int r = 1; r <= degree_; ++r) {
            for (int j = degree_; j >= r; --j) c[at(j)] += c[at(j - 1)];
        }
        // Each coefficient is a sum of `degree` terms whose sizes add up to at most `size`, and
        // whose powers have as many roundings.
        size_ = size;
        error_ = tail + 4 * last_terms(terms, guard_.which, h_) +
                 4 * degree_ * std::numeric_limits<double>::epsilon() * size;
    }

    /// Replaces the coefficients on [0, 1] by those on [0, u], or [u, 1].
    void keep_left(Coefficients& c, double u) noexcept
    {
        for (int r = 1; r <= degree_; ++r) {
            for (int j = degree_; j >= r; --j) c[at(j)] = (1 - u) * c[at(j - 1)] + u * c[at(j)];
        }
    }
    void keep_right(Coefficients& c, double u) noexcept
    {
        for (int r = 1; r <= degree_; ++r) {
            for (int j = 0; j <= degree_ - r; ++j) c[at(j)] = (1 - u) * c[at(j)] + u * c[at(j + 1)];
        }
    }

    /// @param a, b  the interval of the coefficients, as offsets [s]
    /// @param root  whether there is a root at a, which does not count
    [[nodiscard]] SeriesInterval first(const Coefficients& c, double a, double b,
                                       bool root) noexcept
    {
        using Kind = SeriesInterval::Kind;
        const int from = root ? 1 : 0;
        int changes = 0;
        bool sure = true;
        double least = c[at(from)];
        double before = c[at(from)];
        for (int j = from; j <= degree_; ++j) {
            least = std::min(least, c[at(j)]);
            sure = sure && std::fabs(c[at(j)]) > error_;
            changes += (c[at(j)] < 0) != (before < 0);
            before = c[at(j)];
        }
        // With a root at a, the others are, up to positive factors, coefficients of p(u) / u.
        const bool ends_above = c[at(degree_)] - error_ > touch_;
        if (root ? least - error_ > 0 && ends_above : least - error_ > touch_) {
            return {Kind::clear, a, b};
        }
        if (sure && changes == 1 && c[at(from)] > 0 && touch_ == 0) return {Kind::crossing, a, b};
        if (!(b - a > smallest_part * h_) || !std::isfinite(least)) return {Kind::unsure, a, b};
        const double middle = a + 0.5 * (b - a);
        Coefficients half = c;
        keep_left(half, 0.5);
        const SeriesInterval left = first(half, a, middle, root);
        if (left.kind != Kind::clear) return left;
        half = c;
        keep_right(half, 0.5);
        const SeriesInterval right = first(half, middle, b, false);
        return right.kind == Kind::clear ? SeriesInterval{Kind::clear, a, b} : right;
    }

private:
    [[nodiscard]] static constexpr std::size_t at(int i) noexcept
    {
        return static_cast<std::size_t>(i);
    }

    const GuardSeries& guard_;
    int degree_;
    double h_;
    double touch_;
    double error_ = 0;
    double size_ = 0;
};

}  // namespace

bool series_clears_closely(GuardSeries guard) noexcept
{
    using Kind = SeriesInterval::Kind;
    Coefficients c;
    const int degree = degree_of(guard);
    // A root at the start is a root of the sum of all terms, not of the first.
    constexpr int some = 8;
    if (degree > some && !guard.from_surface) {
        SeriesSearch search(guard, some);
        search.convert(c);
        if (search.first(c, 0, guard.h, false).kind == Kind::clear) return true;
    }
    SeriesSearch search(guard, degree);
    search.convert(c);
    if (guard.from_surface && !search.starts_at_root(c)) return false;
    return search.first(c, 0, guard.h, guard.from_surface).kind == Kind::clear;
}

SeriesInterval first_leaving(const GuardSeries& guard, const GuardSample& start,
                             const GuardSample& end) noexcept
{
    SeriesSearch search(guard, degree_of(guard));
    Coefficients c;
    search.convert(c);
    if (end.s < guard.h) search.keep_left(c, end.s / guard.h);
    if (start.s > 0) search.keep_right(c, start.s / end.s);
    search.blur(c, guard.sign * start.value, guard.sign * end.value);
    return search.first(c, start.s, end.s, search.starts_at_root(c));
}

}  // namespace ricochet::detail
