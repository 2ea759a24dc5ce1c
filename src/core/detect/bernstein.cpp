#include "ricochet/bernstein.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "bernstein_basis.hpp"
#include "guard_walk.hpp"

namespace ricochet::detail {

namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// Samples at the nodes of degree `sampled_degree` that lie between those of half the degree,
/// from the quartic through the latter.
struct QuarticCheck {
    static constexpr int half = sampled_degree / 2;
    std::array<std::array<double, half + 1>, half> weights{};
};

[[nodiscard]] constexpr std::size_t at(int i) noexcept
{
    return static_cast<std::size_t>(i);
}

[[nodiscard]] double sign_of(Side side) noexcept
{
    return side == Side::above ? 1 : -1;
}

[[nodiscard]] QuarticCheck make_quartic_check() noexcept
{
    constexpr int half = QuarticCheck::half;
    const BernsteinBasis& quartic = bernstein_basis(half);
    const BernsteinBasis& fine = bernstein_basis(sampled_degree);
    QuarticCheck check;
    for (int k = 0; k < half; ++k) {
        for (int j = 0; j <= half; ++j) {
            check.weights[at(k)][at(j)] = bernstein_value(&quartic.matrix[at(j * (half + 1))], half,
                                                          fine.nodes[at(2 * k + 1)]);
        }
    }
    return check;
}

/// Largest |value| of n + 1 samples, NaN if one of them is.
[[nodiscard]] double largest(const double* values, int n) noexcept
{
    double result = 0;
    for (int j = 0; j <= n; ++j) {
        const double size = std::fabs(values[j]);
        result = result >= size ? result : size;
        if (std::isnan(size)) return size;
    }
    return result;
}

/// Error of a coefficient for samples no larger than `size`, rounding of their times included.
[[nodiscard]] double rounding(const BernsteinBasis& basis, double size, double clock,
                              double width) noexcept
{
    return size * (basis.rounding + basis.norm * 2 * clock / width);
}

/// Whether the interval begins at an event, or on the surface with the guard heading for its side.
[[nodiscard]] bool starts_on_surface(const Watch& watch, double band) noexcept
{
    const double sign = sign_of(watch.side);
    return watch.start.s > 0 || (sign * watch.start.value <= band && sign * watch.start.rate >= 0);
}

/// The least of n + 1 coefficients times `sign`, starting from the index `first`.
[[nodiscard]] double least(const double* c, int n, double sign, int first = 0) noexcept
{
    double result = sign * c[first];
    for (int i = first + 1; i <= n; ++i) result = std::min(result, sign * c[i]);
    return result;
}

/// Largest difference between the samples of a guard at the odd nodes of `sampled_degree`
/// and the quartic through the other samples; NaN if one of the samples is NaN.
[[nodiscard]] double misfit(const double* values, const double* even) noexcept
{
    static const QuarticCheck check = make_quartic_check();
    double worst = 0;
    for (int k = 0; k < QuarticCheck::half; ++k) {
        double difference = -values[2 * k + 1];
        for (int j = 0; j <= QuarticCheck::half; ++j) {
            difference += check.weights[at(k)][at(j)] * even[j];
        }
        if (std::isnan(difference)) return difference;
        worst = std::max(worst, std::fabs(difference));
    }
    return worst;
}

}  // namespace

bool stays_on_side(const BernsteinTask& task, const Watch& watch, const double* values) noexcept
{
    const int last = task.degree > 0 ? task.degree : sampled_degree;
    const double sign = sign_of(watch.side);
    if (!(sign * values[last] > watch.touch)) return false;
    // A root at the start is divided out: p(u) / u has the coefficients c_(i+1) n / (i+1).
    const int first = starts_on_surface(watch, watch.touch) ? 1 : 0;
    const double width = watch.end.s - watch.start.s;
    Coefficients c;
    double error = 0;
    const auto clears = [&](const BernsteinBasis& basis, const double* samples) {
        basis.convert(samples, c.data());
        error += rounding(basis, largest(samples, basis.degree), task.clock, width);
        return least(c.data(), basis.degree, sign, first) - error > watch.touch;
    };
    if (task.degree > 0) return clears(bernstein_basis(task.degree), values);

    std::array<double, QuarticCheck::half + 1> even;
    for (int j = 0; j <= QuarticCheck::half; ++j) even[at(j)] = values[2 * j];
    error = 4 * misfit(values, even.data());
    return clears(bernstein_basis(QuarticCheck::half), even.data());
}

namespace {

/// The search of one interval.
class Search {
public:
    /// @param values the samples at the nodes of the whole interval
    Search(const BernsteinTask& task, Watch& watch, const double* values, const GuardCurve& curve)
        : task_(task),
          watch_(watch),
          curve_(curve),
          degree_(task.degree > 0 ? task.degree : sampled_degree),
          whole_(fit(watch.start.s, watch.end.s, values)),
          scales_{.band = std::max(watch.touch, 16 * epsilon * whole_.size),
                  .noise = std::max(watch.touch / 8, 8 * epsilon * whole_.size)},
          walk_(watch, task.crossing, values[0], scales_)
    {
    }

    [[nodiscard]] Finding run()
    {
        Piece piece;
        piece.c = whole_.c;
        if (task_.degree > 0 && whole_.fits && excludes(piece, 0)) {
            return Finding::clear(Evidence::proved);
        }
        if (task_.degree > 0 && !is_precise(whole_)) {
            // Ill-conditioned, or not a polynomial of the declared degree.
            degree_ = sampled_degree;
            whole_ = fit(watch_.start.s, watch_.end.s);
        }
        scan(whole_, 0);
        finish();
        if (walk_.decided()) return walk_.finding();
        watch_.side_after = walk_.side();
        return Finding::clear(evidence_);
    }

private:
    /// The guard on a part of the interval, as a polynomial.
    struct Fit {
        double from = 0;  ///< [s] offset
        double to = 0;    ///< [s] offset
        Coefficients values{};
        Coefficients c{};
        double size = 0;      ///< largest |sample|
        double misfit = 0;    ///< largest difference from the guard at further samples
        double error = 0;     ///< bound on the error of the fit and of its coefficients
        bool finite = false;  ///< all samples are finite
        bool any = false;     ///< some sample is a number
        bool fits = false;    ///< it agrees with the guard, as far as its conditioning allows

        [[nodiscard]] double width() const noexcept { return to - from; }  ///< [s]
        [[nodiscard]] double place(double u) const noexcept
        {
            return u < 1 ? from + u * (to - from) : to;
        }
    };

    /// A part [from, to] of [0, 1] on which a fit has coefficients of its own.
    struct Piece {
        double from = 0;
        double to = 1;
        Coefficients c{};
    };

    // --- fits ---

    [[nodiscard]] Fit fit(double from, double to, const double* known = nullptr)
    {
        ++fits_;
        const BernsteinBasis& basis = bernstein_basis(degree_);
        Fit fit;
        fit.from = from;
        fit.to = to;
        fit.finite = true;
        for (int j = 0; j <= degree_; ++j) {
            const double value = known ? known[j] : curve_(fit.place(basis.nodes[at(j)]));
            fit.values[at(j)] = value;
            fit.any = fit.any || !std::isnan(value);
            fit.finite = fit.finite && std::isfinite(value);
        }
        if (fit.finite) complete(fit, basis);
        return fit;
    }

    void complete(Fit& fit, const BernsteinBasis& basis)
    {
        const int n = degree_;
        basis.convert(fit.values.data(), fit.c.data());
        fit.size = largest(fit.values.data(), n);
        for (const int eighth : {0, 2, 5, 7}) {
            // Between two nodes, where the interpolation error is large.
            const int j = eighth * n / 8;
            const double u = 0.5 * (basis.nodes[at(j)] + basis.nodes[at(j + 1)]);
            const double value = curve_(fit.place(u));
            const double difference = std::fabs(value - bernstein_value(fit.c.data(), n, u));
            fit.misfit = std::max(fit.misfit, difference);
            fit.finite = fit.finite && std::isfinite(value);
        }
        // Halving a polynomial rounds every coefficient up to n times.
        fit.error = rounding(basis, fit.size, task_.clock, fit.width()) +
                    25 * n * epsilon * largest(fit.c.data(), n);
        fit.fits = fit.finite && fit.misfit <= fit.error + watch_.touch;
        if (n != task_.degree) fit.error += 4 * fit.misfit;
    }

    /// Whether the fit resolves on which side of the surface the guard turns.
    [[nodiscard]] bool is_precise(const Fit& fit) const noexcept
    {
        return fit.finite && fit.misfit <= scales_.band / 2;
    }

    /// Walks along a part of the interval, in halves if it takes more than one
    /// polynomial.
    void scan(const Fit& fit, int halvings)
    {
        if (fit.to == watch_.end.s) note_end(fit);
        if (is_precise(fit) || (fit.finite && keeps_off(fit.c.data(), fit.error))) {
            Piece piece;
            piece.c = fit.c;
            return cut(fit, piece);
        }
        // A misfit that is small and stays as large on ever shorter parts is rounding in the guard.
        misfits_[at(halvings)] = fit.misfit;
        const bool improves = halvings < 4 || fit.misfit > 1e-7 * whole_.size ||
                              fit.misfit <= 0.5 * misfits_[at(halvings - 4)];
        if (fit.any && improves && halvings < most_halvings && fits_ < most_fits) {
            const double middle = fit.place(0.5);
            scan(this->fit(fit.from, middle), halvings + 1);
            if (walk_.crossed() && !walk_.decided()) walk_.close();
            if (walk_.decided()) return;
            return scan(this->fit(middle, fit.to), halvings + 1);
        }
        if (!fit.finite || fits_ >= most_fits) evidence_ = Evidence::assumed;
        const BernsteinBasis& basis = bernstein_basis(degree_);
        for (int j = 1; j <= degree_; ++j) {
            pass({.s = fit.place(basis.nodes[at(j)]), .value = fit.values[at(j)]});
        }
    }

    // --- pieces of a fit ---

    /// Whether the polynomial of the whole interval has neither a root nor a touch in a piece.
    [[nodiscard]] bool excludes(Piece& piece, int halvings)
    {
        const double* c = piece.c.data();
        if (leaves_surface(whole_, piece)) return true;
        const double sign = sign_of(watch_.side);
        const double margin = scales_.band + whole_.error;
        const bool starts = piece.from == 0 && starts_on_surface(watch_, scales_.band);
        if (least(c, degree_, sign) > margin) return true;
        if (!(sign * c[degree_] > margin && (starts || sign * c[0] > margin))) return false;
        if (halvings == most_halvings) return false;
        Piece right = split(piece);
        return excludes(piece, halvings + 1) && excludes(right, halvings + 1);
    }

    /// Cuts a fit until the guard is monotone on every piece, and walks along the pieces.
    void cut(const Fit& fit, Piece& piece)
    {
        if (walk_.decided()) return;
        const double* c = piece.c.data();
        if (keeps_off(c, fit.error) || leaves_surface(fit, piece) || is_settled(piece)) {
            return step_to(fit, piece);
        }
        if (bends_one_way(c, degree_)) {
            const double u = piece.from + (piece.to - piece.from) * turning_point(c, degree_);
            pass({.s = fit.place(u), .value = curve_(fit.place(u)), .rate = 0});
            return step_to(fit, piece);
        }
        Piece right = split(piece);
        cut(fit, piece);
        cut(fit, right);
    }

    /// Halves a piece: it keeps its first half, and the second is returned.
    [[nodiscard]] Piece split(Piece& piece) const noexcept
    {
        Piece right;
        halve(piece.c.data(), degree_, right.c.data());
        right.to = piece.to;
        right.from = piece.to = 0.5 * (piece.from + piece.to);
        return right;
    }

    /// Whether all coefficients are well off the surface, on the same side.
    [[nodiscard]] bool keeps_off(const double* c, double error) const noexcept
    {
        const double margin = scales_.band + error;
        return least(c, degree_, 1) > margin || least(c, degree_, -1) > margin;
    }

    /// Whether all coefficients but the first are off the surface, and the first is at the start.
    [[nodiscard]] bool leaves_surface(const Fit& fit, const Piece& piece) const noexcept
    {
        if (piece.from > 0 || fit.from > watch_.start.s) return false;
        return starts_on_surface(watch_, scales_.band) &&
               least(piece.c.data(), degree_, sign_of(watch_.side), 1) > scales_.band + fit.error;
    }

    /// Whether the piece is monotone, flat up to rounding, or too short to be cut.
    [[nodiscard]] bool is_settled(const Piece& piece)
    {
        const double* c = piece.c.data();
        const bool is_flat = -least(c, degree_, -1) - least(c, degree_, 1) <= scales_.noise;
        if (is_flat || is_monotone(c, degree_)) return true;
        if (++pieces_ <= most_pieces) return piece.to - piece.from < 0x1p-48;
        evidence_ = Evidence::assumed;
        return true;
    }

    [[nodiscard]] static bool is_monotone(const double* c, int n) noexcept
    {
        bool rises = true;
        bool falls = true;
        for (int i = 0; i < n; ++i) {
            rises = rises && c[i + 1] >= c[i];
            falls = falls && c[i + 1] <= c[i];
        }
        return rises || falls;
    }

    [[nodiscard]] static bool bends_one_way(const double* c, int n) noexcept
    {
        Coefficients slopes;
        for (int i = 0; i < n; ++i) slopes[at(i)] = c[i + 1] - c[i];
        return is_monotone(slopes.data(), n - 1);
    }

    /// Zero of the slope, which is monotone and has different signs at the ends.
    [[nodiscard]] static double turning_point(const double* c, int n) noexcept
    {
        Coefficients slopes;
        for (int i = 0; i < n; ++i) slopes[at(i)] = c[i + 1] - c[i];
        const bool rises = slopes[at(n - 1)] > 0;
        double lo = 0;
        double hi = 1;
        double u = slopes[0] / (slopes[0] - slopes[at(n - 1)]);
        for (int i = 0; i < 60 && u > lo && u < hi; ++i) {
            const double slope = bernstein_value(slopes.data(), n - 1, u);
            if (slope == 0) break;
            ((slope > 0) == rises ? hi : lo) = u;
            const double next = u - slope / bernstein_slope(slopes.data(), n - 1, u);
            if (std::fabs(next - u) <= epsilon) break;
            u = next > lo && next < hi ? next : 0.5 * (lo + hi);
        }
        return u;
    }

    /// Passes on to the walk the value of the guard itself at the end of a piece.
    void step_to(const Fit& fit, const Piece& piece)
    {
        const double* last = piece.c.data() + degree_;
        const double s = fit.place(piece.to);
        pass({.s = s,
              .value = piece.to < 1 ? curve_(s) : fit.values[at(degree_)],
              .rate = degree_ * (last[0] - last[-1]) / ((piece.to - piece.from) * fit.width())});
    }

    void pass(const GuardSample& sample) noexcept
    {
        if (sample.s < watch_.end.s) walk_.pass(sample);
    }

    // --- the end ---

    void note_end(const Fit& fit) noexcept
    {
        last_ = fit.finite ? fit.c : Coefficients{};
        last_width_ = fit.width();
        last_error_ = fit.error;
    }

    void finish()
    {
        GuardSample end = watch_.end;
        const double* last = last_.data() + degree_;
        if (std::isnan(end.rate)) end.rate = degree_ * (last[0] - last[-1]) / last_width_;
        walk_.end(end, std::fabs(end.value) <= scales_.band ? heading(end) : 0);
    }

    /// Direction of the guard after the end, where it is on its surface: 1, back to its side
    /// without leaving the band across the surface; -1, across; 0, not decidable.
    [[nodiscard]] int heading(const GuardSample& end) const
    {
        const double sign = sign_of(walk_.side());
        double lowest = sign * end.value;
        for (double u = 0x1p-24; u <= 0.25; u *= 2) {
            const double error = task_.goes_on ? 0 : std::min(1.0, 2 * degree_ * u) * last_error_;
            const double value = sign * beyond(end, u);
            if (value < -scales_.band - error) return -1;
            if (value > lowest + scales_.noise + error) return 1;
            lowest = std::min(lowest, value);
        }
        const double near = sign * (beyond(end, 0.125) - end.value);
        const double far = sign * (beyond(end, 0.25) - end.value);
        const double bend = 32 * (far - 2 * near);  // half the curvature
        const double slope = 16 * near - 4 * far;
        const bool turns = sign * end.value - slope * (slope / (4 * bend)) >= -scales_.band;
        return bend > 0 && turns ? 1 : 0;
    }

    /// Value of the guard at a fraction u of the last fit's width after its end.
    [[nodiscard]] double beyond(const GuardSample& end, double u) const
    {
        if (task_.goes_on) return curve_(end.s + u * last_width_);
        return end.value + (bernstein_value(last_.data(), degree_, 1 + u) - last_[at(degree_)]);
    }

    static constexpr int most_halvings = 20;
    static constexpr int most_fits = 2000;
    static constexpr int most_pieces = 5000;

    const BernsteinTask& task_;
    Watch& watch_;
    const GuardCurve& curve_;
    int degree_;
    int fits_ = 0;
    int pieces_ = 0;
    Fit whole_;
    GuardWalk::Scales scales_;
    GuardWalk walk_;
    std::array<double, most_halvings + 1> misfits_{};  ///< misfits of the fits being halved
    Coefficients last_{};  ///< coefficients of the last fit, with its width and error
    double last_width_ = 1;
    double last_error_ = 0;
    Evidence evidence_ = Evidence::checked;  ///< evidence for a clear interval
};

}  // namespace

Finding first_event(const BernsteinTask& task, Watch& watch, const double* values,
                    const GuardCurve& curve)
{
    return Search(task, watch, values, curve).run();
}

}  // namespace ricochet::detail

namespace ricochet {

detail::Finding Bernstein::examine(GuardPath& path, detail::Watch& watch) const
{
    watch.side_after = watch.side;
    const double width = watch.end.s - watch.start.s;
    if (watch.side == Side::plateau || !(width > 0)) {
        return detail::Finding::clear(Evidence::checked);
    }
    const int degree = path.degree();
    // Rounding [s] of a time in the step.
    const double clock =
        1.2e-16 * std::max(std::fabs(path.time(0)), std::fabs(path.time(path.h())));
    const detail::BernsteinTask task{
        .crossing = path.crossing(),
        .degree = degree <= detail::most_bernstein_degree ? degree : 0,
        .clock = clock,
        .goes_on = path.is_polynomial() && path.latest() >= 1.25 * path.h()};
    const int n = task.degree > 0 ? task.degree : detail::sampled_degree;
    const double* nodes = detail::bernstein_nodes(n);
    std::array<double, detail::most_bernstein_degree + 1> values;
    const auto at = [&](int j) -> double& { return values[static_cast<std::size_t>(j)]; };
    const auto sample = [&](int j) {
        return path.dense_value(watch.start.s + width * nodes[j]).value;
    };
    at(0) = watch.start.s == 0 ? watch.start.value : sample(0);
    for (int j = 1; j < n; ++j) at(j) = sample(j);
    at(n) = watch.end.s == path.h() ? watch.end.value : sample(n);

    if (detail::stays_on_side(task, watch, values.data())) {
        return detail::Finding::clear(task.degree > 0 ? Evidence::proved : Evidence::checked);
    }
    return detail::first_event(task, watch, values.data(), detail::GuardCurve(path));
}

}  // namespace ricochet
