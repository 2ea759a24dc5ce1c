#include "ricochet/detail/lazy_tape.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>
#include <utility>

#include "ricochet/detail/taylor_series.hpp"

namespace ricochet::detail {

namespace {

/// Key of an operation: two operations with the same key have the same result.
using Key = std::tuple<TaylorOp, int, int, int, std::uint64_t, std::uint64_t>;

Key key_of(const TapeOp& op, double constant)
{
    return {op.op,
            op.a,
            op.b,
            op.c,
            std::bit_cast<std::uint64_t>(op.exponent),
            std::bit_cast<std::uint64_t>(constant)};
}

/// sum of a_j b_{k-j} for j from lo to hi
double convolve(int k, int lo, int hi, const double* a, const double* b)
{
    if (hi < lo) return 0;
    return reversed_products[static_cast<std::size_t>(hi - lo)](a + lo, b + (k - lo));
}

/// sum of a_j a_{k-j} for j from lo to k - lo
double square(int k, int lo, const double* a)
{
    const double twice = 2 * convolve(k, lo, (k - 1) / 2, a, a);
    return k % 2 == 0 && lo <= k / 2 ? twice + a[k / 2] * a[k / 2] : twice;
}

}  // namespace

LazyTape::LazyTape(std::size_t states, const Recording& as_called, std::vector<int> outputs)
{
    tape_.states = states;
    tape_.guards = outputs.size() - states;
    tape_.outputs = std::move(outputs);
    Recording recording;
    put_in_order(states, as_called, recording, tape_.outputs);
    simplify(recording);
    add_partners();
    tape_.ops_count = tape_.ops.size();
    tape_.degree.assign(tape_.ops_count, 0);
    tape_.for_guards.assign(tape_.ops_count, false);
    find_degrees(tape_);
    mark_for_guards(tape_);
    degree_ = polynomial_order(tape_);
    find_slopes();
    coefficients_.assign(tape_.ops_count * width, 0);
    slopes_.assign(tape_.ops_count * width, 0);
    inverses_.assign(tape_.ops_count, 0);
}

/// The operand that an operation only repeats, or -1. An operation that is always zero becomes a
/// constant; derivatives by dual numbers contain many of both.
int LazyTape::repeated(TapeOp& op, double& constant) const
{
    const auto is_zero = [&](int i) {
        const auto at = static_cast<std::size_t>(i);
        return tape_.ops[at].op == TaylorOp::constant && constants_[at] == 0;
    };
    bool vanishes = false;
    switch (op.op) {
        case TaylorOp::sum: return is_zero(op.a) ? op.b : is_zero(op.b) ? op.a : -1;
        case TaylorOp::difference: return is_zero(op.b) ? op.a : -1;
        case TaylorOp::plus_constant:
        case TaylorOp::minus_constant: return constant == 0 ? op.a : -1;
        case TaylorOp::times_constant:
        case TaylorOp::over_constant:
            if (constant == 1) return op.a;
            vanishes = constant == 0 || is_zero(op.a);
            break;
        case TaylorOp::product: vanishes = is_zero(op.a) || is_zero(op.b); break;
        case TaylorOp::negative:
        case TaylorOp::square:
        case TaylorOp::quotient: vanishes = is_zero(op.a); break;
        default: break;
    }
    if (vanishes) {
        op = {.op = TaylorOp::constant};
        constant = 0;
    }
    return -1;
}

void LazyTape::simplify(const Recording& recording)
{
    std::vector<int> place;
    std::map<Key, int> known;
    for (int i = 0; i < recording.size(); ++i) {
        const RecordedOp& recorded = recording[i];
        TapeOp op{recorded.op, recorded.a, recorded.b, recorded.c, recorded.exponent};
        for (int* operand : {&op.a, &op.b, &op.c}) {
            if (*operand >= 0) *operand = place[static_cast<std::size_t>(*operand)];
        }
        if (op.op == TaylorOp::product && op.a == op.b) {
            op.op = TaylorOp::square;
            op.b = -1;
        }
        double constant = 0;
        if (has_constant(op.op)) {
            constant = op.op == TaylorOp::over_constant ? 1 / recorded.value : recorded.value;
            finite_ = finite_ && std::isfinite(constant);
        }
        if (const int same = repeated(op, constant); same >= 0) {
            place.push_back(same);
            continue;
        }
        const int next = static_cast<int>(tape_.ops.size());
        int at = next;
        if (op.op != TaylorOp::input) at = known.emplace(key_of(op, constant), next).first->second;
        if (at == next) {
            tape_.ops.push_back(op);
            constants_.push_back(constant);
        }
        place.push_back(at);
    }
    for (int& output : tape_.outputs) output = place[static_cast<std::size_t>(output)];
}

void LazyTape::add_partners()
{
    std::map<std::pair<TaylorOp, int>, int> known;
    for (std::size_t i = tape_.states + 1; i < tape_.ops.size(); ++i) {
        known.emplace(std::pair(tape_.ops[i].op, tape_.ops[i].a), static_cast<int>(i));
    }
    const auto partner = [&](TaylorOp op, int a) {
        const int next = static_cast<int>(tape_.ops.size());
        const auto [at, added] = known.emplace(std::pair(op, a), next);
        if (added) {
            tape_.ops.push_back({.op = op, .a = a});
            constants_.push_back(0);
        }
        return at->second;
    };
    for (std::size_t i = 0; i < tape_.ops.size(); ++i) {
        const int a = tape_.ops[i].a;
        int b = tape_.ops[i].b;
        switch (tape_.ops[i].op) {
            case TaylorOp::sine: b = partner(TaylorOp::cosine, a); break;
            case TaylorOp::cosine: b = partner(TaylorOp::sine, a); break;
            case TaylorOp::hyperbolic_sine: b = partner(TaylorOp::hyperbolic_cosine, a); break;
            case TaylorOp::hyperbolic_cosine: b = partner(TaylorOp::hyperbolic_sine, a); break;
            case TaylorOp::tangent:
            case TaylorOp::hyperbolic_tangent:
                b = partner(TaylorOp::square, static_cast<int>(i));
                break;
            default: break;
        }
        tape_.ops[i].b = b;
    }
}

void LazyTape::find_slopes()
{
    has_slope_.assign(tape_.ops_count, false);
    const auto want = [&](int i) { has_slope_[static_cast<std::size_t>(i)] = true; };
    for (std::size_t i = tape_.states + 1; i < tape_.ops_count; ++i) {
        const TapeOp& op = tape_.ops[i];
        switch (op.op) {
            case TaylorOp::exponential:
            case TaylorOp::sine:
            case TaylorOp::cosine:
            case TaylorOp::hyperbolic_sine:
            case TaylorOp::hyperbolic_cosine:
            case TaylorOp::tangent:
            case TaylorOp::hyperbolic_tangent: want(op.a); break;
            case TaylorOp::logarithm:
            case TaylorOp::arc_sine:
            case TaylorOp::arc_cosine:
            case TaylorOp::arc_tangent: has_slope_[i] = true; break;
            case TaylorOp::angle:
                has_slope_[i] = true;
                want(op.a);
                want(op.b);
                break;
            default: break;
        }
    }
}

[[gnu::always_inline]] inline double LazyTape::coefficient(std::size_t i, int k) const
{
    const TapeOp& op = tape_.ops[i];
    const double* const a = series(std::max(op.a, 0));
    const double* const b = series(std::max(op.b, 0));
    const double* const own = series(static_cast<int>(i));
    const int da = degree(op.a), db = degree(op.b);
    const int upto_a = std::min(da, k), upto_b = std::min(db, k);
    switch (op.op) {
        case TaylorOp::input:
        case TaylorOp::constant: return 0;
        case TaylorOp::sum: return a[k] + b[k];
        case TaylorOp::difference: return a[k] - b[k];
        case TaylorOp::negative:
        case TaylorOp::constant_minus: return -a[k];
        case TaylorOp::plus_constant:
        case TaylorOp::minus_constant: return a[k];
        case TaylorOp::times_constant:
        case TaylorOp::over_constant: return constants_[i] * a[k];
        case TaylorOp::product: return convolve(k, std::max(0, k - db), upto_a, a, b);
        case TaylorOp::square: return square(k, std::max(0, k - da), a);
        case TaylorOp::quotient: return (a[k] - convolve(k, 1, upto_b, b, own)) * inverses_[i];
        case TaylorOp::constant_over: return convolve(k, 1, upto_a, a, own) * inverses_[i];
        case TaylorOp::square_root: return (a[k] - square(k, 1, own)) * inverses_[i];
        case TaylorOp::power:
        case TaylorOp::cube_root: {
            double sum = 0;
            const double each = (op.exponent + 1) / k;
            for (int j = 1; j <= upto_a; ++j) sum += (each * j - 1) * a[j] * own[k - j];
            return sum * inverses_[i];
        }
        case TaylorOp::exponential:
        case TaylorOp::sine:
        case TaylorOp::cosine:
        case TaylorOp::hyperbolic_sine:
        case TaylorOp::hyperbolic_cosine:
        case TaylorOp::tangent:
        case TaylorOp::hyperbolic_tangent: return coefficient_of_function(i, k);
        case TaylorOp::logarithm:
        case TaylorOp::arc_sine:
        case TaylorOp::arc_cosine:
        case TaylorOp::arc_tangent:
        case TaylorOp::angle: return coefficient_of_inverse(i, k);
    }
    return 0;
}

[[gnu::always_inline]] inline void LazyTape::compute_at(std::size_t i, int k)
{
    double* const own = series(static_cast<int>(i));
    // Coefficients that are zero beyond a degree stay zero.
    if (i > tape_.states && k <= tape_.degree[i]) own[k] = coefficient(i, k);
    if (has_slope_[i]) slopes_[i * width + static_cast<std::size_t>(k)] = k * own[k];
}

int LazyTape::compute(double t, const double* x, const TaylorCoefficients<double>& to)
{
    const int order = is_polynomial() ? degree_ : to.order;
    const std::size_t n = tape_.states;
    for (std::size_t i = 0; i < n; ++i) to.x[i] = coefficients_[i * width] = x[i];
    coefficients_[n * width] = t;
    coefficients_[n * width + 1] = 1;
    for (std::size_t i = n + 1; i < tape_.ops_count; ++i) coefficients_[i * width] = begin(i);
    advance(0, to.x, to.guards);
    for (int k = 1; k < order; ++k) {
        for (std::size_t i = 0; i < tape_.ops_count; ++i) compute_at(i, k);
        advance(k, to.x, to.guards);
    }
    if (tape_.guards > 0) {
        for (std::size_t i = 0; i < tape_.ops_count; ++i) {
            if (tape_.for_guards[i]) compute_at(i, order);
        }
        keep_guards(order, to.guards);
    }
    return order;
}

/// x_{k+1} = f_k / (k + 1)
void LazyTape::advance(int k, double* out, double* guards)
{
    const std::size_t n = tape_.states;
    for (std::size_t i = 0; i < n; ++i) {
        const double next = series(tape_.outputs[i])[k] / (k + 1);
        series(static_cast<int>(i))[k + 1] = next;
        out[static_cast<std::size_t>(k + 1) * n + i] = next;
    }
    keep_guards(k, guards);
}

void LazyTape::keep_guards(int k, double* guards) const
{
    const std::size_t m = tape_.guards;
    for (std::size_t i = 0; i < m; ++i) {
        guards[static_cast<std::size_t>(k) * m + i] = series(tape_.outputs[tape_.states + i])[k];
    }
}

/// Coefficient 0, and the factors of the later ones.
double LazyTape::begin(std::size_t i)
{
    const TapeOp& op = tape_.ops[i];
    const double c = constants_[i];
    const double a = op.a >= 0 ? series(op.a)[0] : 0;
    const double b = op.b >= 0 ? series(op.b)[0] : 0;
    double& inverse = inverses_[i];
    switch (op.op) {
        case TaylorOp::input: break;
        case TaylorOp::constant: return c;
        case TaylorOp::sum: return a + b;
        case TaylorOp::difference: return a - b;
        case TaylorOp::negative: return -a;
        case TaylorOp::product: return a * b;
        case TaylorOp::square: return a * a;
        case TaylorOp::quotient: inverse = 1 / b; return a / b;
        case TaylorOp::plus_constant: return a + c;
        case TaylorOp::minus_constant: return a - c;
        case TaylorOp::constant_minus: return c - a;
        case TaylorOp::times_constant:
        case TaylorOp::over_constant: return c * a;
        case TaylorOp::constant_over: inverse = -1 / a; return c / a;
        case TaylorOp::square_root: inverse = 0.5 / std::sqrt(a); return std::sqrt(a);
        case TaylorOp::power: inverse = 1 / a; return std::pow(a, op.exponent);
        case TaylorOp::cube_root: inverse = 1 / a; return std::cbrt(a);
        case TaylorOp::exponential: return std::exp(a);
        case TaylorOp::logarithm: inverse = 1 / a; return std::log(a);
        case TaylorOp::sine: return std::sin(a);
        case TaylorOp::cosine: return std::cos(a);
        case TaylorOp::hyperbolic_sine: return std::sinh(a);
        case TaylorOp::hyperbolic_cosine: return std::cosh(a);
        case TaylorOp::tangent: return std::tan(a);
        case TaylorOp::hyperbolic_tangent: return std::tanh(a);
        case TaylorOp::arc_sine: inverse = 1 / b; return std::asin(a);
        case TaylorOp::arc_cosine: inverse = 1 / b; return std::acos(a);
        case TaylorOp::arc_tangent: inverse = 1 / b; return std::atan(a);
        case TaylorOp::angle: inverse = 1 / series(op.c)[0]; return std::atan2(a, b);
    }
    return 0;
}

/// Coefficients of functions g(a) with g' = f(a) a'.
double LazyTape::coefficient_of_function(std::size_t i, int k) const
{
    const TapeOp& op = tape_.ops[i];
    const bool is_exponential = op.op == TaylorOp::exponential;
    const double* const f = series(is_exponential ? static_cast<int>(i) : op.b);
    const double sum = convolve(k, 1, std::min(degree(op.a), k), slope(op.a), f) / k;
    switch (op.op) {
        case TaylorOp::cosine: return -sum;
        case TaylorOp::tangent: return series(op.a)[k] + sum;
        case TaylorOp::hyperbolic_tangent: return series(op.a)[k] - sum;
        default: return sum;
    }
}

/// Coefficients of functions g(a) with f(a) g' = a'.
double LazyTape::coefficient_of_inverse(std::size_t i, int k) const
{
    const TapeOp& op = tape_.ops[i];
    const double* const own_slope = slope(static_cast<int>(i));
    const double* const a = series(op.a);
    if (op.op == TaylorOp::angle) {
        // c g' = a' b - b' a
        const int da = degree(op.a), db = degree(op.b);
        const double turn =
            convolve(k, std::max(1, k - db), std::min(da, k), slope(op.a), series(op.b)) -
            convolve(k, std::max(1, k - da), std::min(db, k), slope(op.b), a);
        const int from = std::max(1, k - degree(op.c));
        return (turn - convolve(k, from, k - 1, own_slope, series(op.c))) * inverses_[i] / k;
    }
    const int f = op.op == TaylorOp::logarithm ? op.a : op.b;
    const double sum = convolve(k, std::max(1, k - degree(f)), k - 1, own_slope, series(f)) / k;
    return ((op.op == TaylorOp::arc_cosine ? -a[k] : a[k]) - sum) * inverses_[i];
}

}  // namespace ricochet::detail
