// Internal: the declarations of this header may change without notice.
//
// Taylor coefficients of a motion, from the tape of its flow.
//
// With x(t0 + s) = sum_k x_k s^k and the same for every operation, the flow gives
// (k + 1) x_{k+1} = f_k, and each operation has a recurrence for its own coefficient k from those
// of its operands (Moore, Interval Analysis, 1966, chapter 11; Griewank and Walther, Evaluating
// Derivatives, section 13.2). Coefficients are normalized: f_k is the k-th derivative over k!.
//
// Sums begin with their middle terms and end with the newest coefficients, so that only two
// additions depend on the previous operation. Only short tapes are unrolled over orders, too.
//
// The scalar S of the coefficients is double, or several doubles side by side, one for each of
// several motions: then each has the bits that it has alone.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "ricochet/taylor/detail/taylor_step.hpp"
#include "ricochet/taylor/detail/taylor_sums.hpp"
#include "ricochet/taylor/detail/taylor_tape.hpp"

// The same code is compiled for AVX2 too, where the processor may have it. Two coefficients in one
// register would have to wait for both to be stored: g++ is told not to put them there.
#if defined(__x86_64__) && !defined(__AVX2__)
#define RICOCHET_WIDE_SERIES 1
#if defined(__clang__)
#define RICOCHET_FOR_AVX2 [[gnu::target("avx2")]]
#else
#define RICOCHET_FOR_AVX2 [[gnu::target("avx2"), gnu::optimize("no-tree-slp-vectorize")]]
#endif
#else
#define RICOCHET_WIDE_SERIES 0
#endif

namespace ricochet::detail {

/// Beyond this number only the operations are unrolled: unrolling over the orders too would take
/// the compiler longer than it saves.
inline constexpr std::size_t most_unrolled_ops = 30;
template <const auto& tape>
inline constexpr bool is_unrolled = tape.ops.size() - tape.states - 1 <= most_unrolled_ops;

/// f(a), for each double in it.
template <class F>
[[nodiscard, gnu::always_inline]] inline double map_lanes(double a, const F& f)
{
    return f(a);
}
template <class F>
[[nodiscard, gnu::always_inline]] inline double map_lanes(double a, double b, const F& f)
{
    return f(a, b);
}

/// The coefficients of one motion, computed from `constants`, the time and the state.
/// @tparam tape  of type `TaylorTape`
/// @tparam most  the largest order
/// @tparam S  double, or several, where operations are unrolled
template <const auto& tape, int most, bool unrolled = is_unrolled<tape>, class S = double>
class TaylorSeries {
    using Tape = std::remove_cvref_t<decltype(tape)>;
    static constexpr int n = static_cast<int>(Tape::states);
    static constexpr int m = static_cast<int>(Tape::guards);
    static constexpr int ops = static_cast<int>(Tape::ops_count);

    /// Marks the series for which coefficients times their orders are needed.
    static constexpr auto slopes_wanted = [] {
        std::array<bool, Tape::ops_count> wanted{};
        for (std::size_t i = Tape::states + 1; i < Tape::ops_count; ++i) {
            const TapeOp& op = tape.ops[i];
            const bool is_angle = op.op == TaylorOp::angle;
            if (is_function(op.op) || is_angle) wanted[static_cast<std::size_t>(op.a)] = true;
            if (is_angle) wanted[static_cast<std::size_t>(op.b)] = true;
            if (is_inverse(op.op)) wanted[i] = true;
        }
        return wanted;
    }();
    template <int i>
    static constexpr bool has_slope = slopes_wanted[static_cast<std::size_t>(i)];

public:
    /// The coefficients at (t, x), up to an order that is `most`, `most` - 4 or `most` - 8.
    static void compute(const S* constants, S t, const S* x, const TaylorCoefficients<S>& to)
    {
#if RICOCHET_WIDE_SERIES
        if constexpr (unrolled && most > least_taylor_order) {
            if (__builtin_cpu_supports("avx2")) return compute_wide(constants, t, x, to);
        }
#endif
        compute_inline(constants, t, x, to);
    }
#if RICOCHET_WIDE_SERIES
    /// With the instructions of AVX2, three operands each; none of them rounds otherwise.
    RICOCHET_FOR_AVX2 static void compute_wide(const S* constants, S t, const S* x,
                                               const TaylorCoefficients<S>& to)
    {
        compute_inline(constants, t, x, to);
    }
#endif
    /// The same, for callers that are compiled for another machine.
    [[gnu::always_inline]] static void compute_inline(const S* constants, const S& t, const S* x,
                                                      const TaylorCoefficients<S>& to)
    {
        const int order = to.order;
        S* const out = to.x;
        TaylorSeries series(constants, to.guards);
        for (int i = 0; i < n; ++i) out[i] = series.c_[i][0] = x[i];
        series.c_[n][0] = t;
        series.c_[n][1] = 1;
        if constexpr (unrolled) {
            series.unroll(order, out, std::make_integer_sequence<int, most>{});
        } else {
            series.start(out, std::make_integer_sequence<int, ops>{});
            for (int k = 1; k < order; ++k) {
                series.loop(k, out, std::make_integer_sequence<int, ops>{});
            }
            series.end_guards(std::max(order, 1), std::make_integer_sequence<int, ops>{});
        }
    }

private:
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): see below
    [[gnu::always_inline]] TaylorSeries(const S* constants, S* guards) noexcept
        : constants_(constants), guards_(guards)
    {
        if constexpr (!unrolled) {
            std::fill(c_[n], c_[n] + most + 1, S(0.0));  // the time; all others are written
        }
    }

    [[nodiscard]] static constexpr int degree(int i) noexcept
    {
        return tape.degree[static_cast<std::size_t>(i)];
    }
    [[nodiscard]] static constexpr TapeOp op_at(int i) noexcept
    {
        return tape.ops[static_cast<std::size_t>(i)];
    }
    [[nodiscard]] static constexpr int smaller(int a, int b) noexcept
    {
        return a < b ? a : b;
    }
    [[nodiscard]] static constexpr int larger(int a, int b) noexcept
    {
        return a > b ? a : b;
    }

    template <int... k>
    [[gnu::always_inline]] void unroll(int order, S* out, std::integer_sequence<int, k...>)
    {
        // Stops where the coefficient k + 1 of the state was the last one needed.
        static_cast<void>((... || at_order<k>(order, out)));
    }

    template <int k>
    [[gnu::always_inline]] bool at_order(int order, S* out)
    {
        run<k>(std::make_integer_sequence<int, ops>{});
        [&]<int... i>(std::integer_sequence<int, i...>) __attribute__((always_inline))
        {
            (advance<k, i>(out), ...);
        }
        (std::make_integer_sequence<int, n>{});
        keep_guards<k>();
        if constexpr (k + 1 == most || k + 1 == most - 4 || k + 1 == most - 8) {
            if (order != k + 1) return false;
            if constexpr (m > 0) {
                run_for_guards<k + 1>(std::make_integer_sequence<int, ops>{});
                keep_guards<k + 1>();
            }
            return true;
        }
        return false;
    }

    template <int k>
    [[gnu::always_inline]] void keep_guards()
    {
        [&]<int... i>(std::integer_sequence<int, i...>) __attribute__((always_inline))
        {
            (keep_guard<k, i>(), ...);
        }
        (std::make_integer_sequence<int, m>{});
    }
    template <int k, int i>
    [[gnu::always_inline]] void keep_guard()
    {
        constexpr std::size_t output = std::size_t{n} + std::size_t{i};
        constexpr int guard = tape.outputs[output];
        S value(0.0);
        if constexpr (k <= degree(guard)) value = c_[guard][k];
        guards_[k * m + i] = value;
    }
    template <int k, int... i>
    [[gnu::always_inline]] void run_for_guards(std::integer_sequence<int, i...>)
    {
        (compute_for_guards<k, i>(), ...);
    }
    template <int k, int i>
    [[gnu::always_inline]] void compute_for_guards()
    {
        if constexpr (tape.for_guards[static_cast<std::size_t>(i)]) compute_op<k, i>();
    }

    template <int k, int... i>
    [[gnu::always_inline]] void run(std::integer_sequence<int, i...>)
    {
        (compute_op<k, i>(), ...);
    }

    /// x_{k+1} = f_k / (k + 1)
    template <int k, int i>
    [[gnu::always_inline]] void advance(S* out)
    {
        constexpr int rate = tape.outputs[static_cast<std::size_t>(i)];
        S next(0.0);
        if constexpr (k <= degree(rate)) next = c_[rate][k] * (1.0 / (k + 1));
        c_[i][k + 1] = next;
        out[(k + 1) * n + i] = next;
    }

    /// j times coefficient j of series a
    template <int a>
    [[nodiscard, gnu::always_inline]] const S* slope() const noexcept
    {
        return slope_[a];
    }

    /// The value of an operand at the start; none has a negative index.
    template <int i>
    [[gnu::always_inline]] [[nodiscard]] S value_of() const
    {
        if constexpr (i >= 0) return c_[i][0];
        return S(0.0);
    }

    /// The value of an operation at the start.
    template <int i>
    [[gnu::always_inline]] void begin_op()
    {
        constexpr TapeOp op = op_at(i);
        S& out = c_[i][0];
        const S c = has_constant(op.op) ? constants_[i] : S(0.0);
        const S a = value_of<op.a>();
        const S b = value_of<op.b>();
        if constexpr (op.op == TaylorOp::constant) {
            out = c;
        } else if constexpr (op.op == TaylorOp::sum) {
            out = a + b;
        } else if constexpr (op.op == TaylorOp::difference) {
            out = a - b;
        } else if constexpr (op.op == TaylorOp::negative) {
            out = -a;
        } else if constexpr (op.op == TaylorOp::product) {
            out = a * b;
        } else if constexpr (op.op == TaylorOp::square) {
            out = a * a;
        } else if constexpr (op.op == TaylorOp::quotient) {
            out = a / b;
            inverse_[i] = 1 / b;
        } else if constexpr (op.op == TaylorOp::plus_constant) {
            out = a + c;
        } else if constexpr (op.op == TaylorOp::minus_constant) {
            out = a - c;
        } else if constexpr (op.op == TaylorOp::constant_minus) {
            out = c - a;
        } else if constexpr (op.op == TaylorOp::times_constant ||
                             op.op == TaylorOp::over_constant) {
            out = c * a;
        } else if constexpr (op.op == TaylorOp::constant_over) {
            out = c / a;
            inverse_[i] = -1 / a;
        } else {
            begin_function<i>();
        }
    }

    template <int i>
    [[gnu::always_inline]] void begin_function()
    {
        constexpr TapeOp op = op_at(i);
        const S a = c_[op.a][0];
        S& out = c_[i][0];
        const auto of_a = [&](const auto& f) __attribute__((always_inline))
        {
            return map_lanes(a, f);
        };
        if constexpr (op.op == TaylorOp::square_root) {
            out = of_a([](double v) { return std::sqrt(v); });
            inverse_[i] = 0.5 / out;
        } else if constexpr (op.op == TaylorOp::power) {
            out = of_a([](double v) { return std::pow(v, op_at(i).exponent); });
            inverse_[i] = 1 / a;
        } else if constexpr (op.op == TaylorOp::cube_root) {
            out = of_a([](double v) { return std::cbrt(v); });
            inverse_[i] = 1 / a;
        } else if constexpr (op.op == TaylorOp::exponential) {
            out = of_a([](double v) { return std::exp(v); });
        } else if constexpr (op.op == TaylorOp::logarithm) {
            out = of_a([](double v) { return std::log(v); });
            inverse_[i] = 1 / a;
        } else if constexpr (op.op == TaylorOp::sine || op.op == TaylorOp::cosine) {
            constexpr bool is_sine = op.op == TaylorOp::sine;
            if constexpr (std::is_same_v<S, double>) {
                out = is_sine ? std::sin(a) : std::cos(a);
            } else if constexpr (op.b > i) {
                S& other = c_[op.b][0];
                map_circle(a, is_sine ? out : other, is_sine ? other : out);
            }  // else its partner has computed both
        } else if constexpr (op.op == TaylorOp::hyperbolic_sine) {
            out = of_a([](double v) { return std::sinh(v); });
        } else if constexpr (op.op == TaylorOp::hyperbolic_cosine) {
            out = of_a([](double v) { return std::cosh(v); });
        } else if constexpr (op.op == TaylorOp::tangent) {
            out = of_a([](double v) { return std::tan(v); });
        } else if constexpr (op.op == TaylorOp::hyperbolic_tangent) {
            out = of_a([](double v) { return std::tanh(v); });
        } else if constexpr (op.op == TaylorOp::arc_sine) {
            out = of_a([](double v) { return std::asin(v); });
            inverse_[i] = 1 / c_[op.b][0];
        } else if constexpr (op.op == TaylorOp::arc_cosine) {
            out = of_a([](double v) { return std::acos(v); });
            inverse_[i] = 1 / c_[op.b][0];
        } else if constexpr (op.op == TaylorOp::arc_tangent) {
            out = of_a([](double v) { return std::atan(v); });
            inverse_[i] = 1 / c_[op.b][0];
        } else if constexpr (op.op == TaylorOp::angle) {
            out = map_lanes(a, c_[op.b][0], [](double y, double x) { return std::atan2(y, x); });
            inverse_[i] = 1 / c_[op.c][0];
        }
    }

    template <int k, int i>
    [[gnu::always_inline]] void compute_op()
    {
        if constexpr (i > n && k <= degree(i)) {
            if constexpr (k == 0) {
                begin_op<i>();
            } else {
                c_[i][k] = coefficient<k, i>();
            }
        }
        if constexpr (k > 0 && has_slope<i> && k <= degree(i)) slope_[i][k] = k * c_[i][k];
    }

    template <int k, int i>
    [[nodiscard, gnu::always_inline]] S coefficient() const
    {
        using Sum = AtOrder<k>;
        constexpr TapeOp op = op_at(i);
        constexpr int da = degree(larger(op.a, 0));
        constexpr int db = degree(larger(op.b, 0));
        const S* const a = c_[larger(op.a, 0)];
        const S* const b = c_[larger(op.b, 0)];
        const S* const own = c_[i];
        // Ranges of j in sums of a_j b_{k-j}; sums with coefficients of i itself go to k - 1.
        constexpr int upto_a = smaller(da, k);
        constexpr int upto_b = smaller(db, k);
        if constexpr (op.op == TaylorOp::sum) {
            if constexpr (k > da) return b[k];
            if constexpr (k > db) return a[k];
            if constexpr (k <= da && k <= db) return a[k] + b[k];
        } else if constexpr (op.op == TaylorOp::difference) {
            if constexpr (k > da) return -b[k];
            if constexpr (k > db) return a[k];
            if constexpr (k <= da && k <= db) return a[k] - b[k];
        } else if constexpr (op.op == TaylorOp::negative || op.op == TaylorOp::constant_minus) {
            return -a[k];
        } else if constexpr (op.op == TaylorOp::plus_constant ||
                             op.op == TaylorOp::minus_constant) {
            return a[k];
        } else if constexpr (op.op == TaylorOp::times_constant ||
                             op.op == TaylorOp::over_constant) {
            return constants_[i] * a[k];
        } else if constexpr (op.op == TaylorOp::product) {
            return Sum::template convolve<larger(0, k - db), upto_a>(a, b);
        } else if constexpr (op.op == TaylorOp::square) {
            return square<k, larger(0, k - da)>(a);
        } else if constexpr (op.op == TaylorOp::quotient) {
            const S sum = Sum::template convolve<1, upto_b>(b, own);
            if constexpr (k > da) return -sum * inverse_[i];
            if constexpr (k <= da) return (a[k] - sum) * inverse_[i];
        } else if constexpr (op.op == TaylorOp::constant_over) {
            return Sum::template convolve<1, upto_a>(a, own) * inverse_[i];
        } else {
            return coefficient_of_function<k, i>();
        }
    }

    template <int k, int i>
    [[nodiscard, gnu::always_inline]] S coefficient_of_function() const
    {
        using Sum = AtOrder<k>;
        constexpr TapeOp op = op_at(i);
        constexpr int da = degree(larger(op.a, 0));
        constexpr int db = degree(larger(op.b, 0));
        const S* const a = c_[larger(op.a, 0)];
        const S* const b = c_[larger(op.b, 0)];
        const S* const own = c_[i];
        // Ranges of j in sums of a_j b_{k-j}; sums with coefficients of i itself go to k - 1.
        constexpr int upto_a = smaller(da, k);
        constexpr int upto_b = smaller(db, k);
        if constexpr (op.op == TaylorOp::square_root) {
            const S sum = square<k, 1>(own);
            if constexpr (k > da) return -sum * inverse_[i];
            if constexpr (k <= da) return (a[k] - sum) * inverse_[i];
        } else if constexpr (op.op == TaylorOp::power || op.op == TaylorOp::cube_root) {
            return Sum::template power<upto_a>(op.exponent, a, own) * inverse_[i];
        } else if constexpr (op.op == TaylorOp::exponential) {
            return Sum::template convolve<1, upto_a>(slope<op.a>(), own) * (1.0 / k);
        } else if constexpr (op.op == TaylorOp::sine || op.op == TaylorOp::hyperbolic_sine ||
                             op.op == TaylorOp::hyperbolic_cosine) {
            return Sum::template convolve<1, upto_a>(slope<op.a>(), b) * (1.0 / k);
        } else if constexpr (op.op == TaylorOp::cosine) {
            return Sum::template convolve<1, upto_a>(slope<op.a>(), b) * (-1.0 / k);
        } else if constexpr (op.op == TaylorOp::tangent) {
            const S sum = Sum::template convolve<1, upto_a>(slope<op.a>(), b) * (1.0 / k);
            if constexpr (k > da) return sum;
            if constexpr (k <= da) return a[k] + sum;
        } else if constexpr (op.op == TaylorOp::hyperbolic_tangent) {
            const S sum = Sum::template convolve<1, upto_a>(slope<op.a>(), b) * (1.0 / k);
            if constexpr (k > da) return -sum;
            if constexpr (k <= da) return a[k] - sum;
        } else if constexpr (op.op == TaylorOp::logarithm || op.op == TaylorOp::arc_sine ||
                             op.op == TaylorOp::arc_cosine || op.op == TaylorOp::arc_tangent) {
            // b g' = a', or -a'
            constexpr bool log = op.op == TaylorOp::logarithm;
            constexpr int d = log ? da : db;
            const S sum = Sum::template convolve<larger(1, k - d), k - 1>(slope<i>(), log ? a : b) *
                          (1.0 / k);
            S first(0.0);
            if constexpr (k <= da) first = op.op == TaylorOp::arc_cosine ? -a[k] : a[k];
            return (first - sum) * inverse_[i];
        } else if constexpr (op.op == TaylorOp::angle) {
            // c g' = a' b - b' a
            constexpr int dc = degree(larger(op.c, 0));
            const S turn = Sum::template convolve<larger(1, k - db), upto_a>(slope<op.a>(), b) -
                           Sum::template convolve<larger(1, k - da), upto_b>(slope<op.b>(), a);
            const S sum = Sum::template convolve<larger(1, k - dc), k - 1>(slope<i>(), c_[op.c]);
            return (turn - sum) * (inverse_[i] * (1.0 / k));
        }
    }

    /// sum of a_j a_{k-j} for j from lo to k - lo
    template <int k, int lo>
    [[nodiscard, gnu::always_inline]] static S square(const S* a)
    {
        const S twice = 2 * AtOrder<k>::template convolve<lo, (k - 1) / 2>(a, a);
        if constexpr (k % 2 == 0 && lo <= k / 2) return twice + a[k / 2] * a[k / 2];
        return twice;
    }

    // --- loops over the orders ---

    template <int... i>
    [[gnu::always_inline]] void start(S* out, std::integer_sequence<int, i...>)
    {
        (compute_op<0, i>(), ...);
        advance_all(0, out);
    }
    template <int... i>
    [[gnu::always_inline]] void loop(int k, S* out, std::integer_sequence<int, i...>)
    {
        (compute_at<i>(k), ...);
        advance_all(k, out);
    }
    void advance_all(int k, S* out)
    {
        for (int i = 0; i < n; ++i) {
            const int rate = tape.outputs[static_cast<std::size_t>(i)];
            const S next = c_[rate][k] / (k + 1);
            c_[i][k + 1] = next;
            out[(k + 1) * n + i] = next;
        }
        keep_guards_at(k);
    }
    void keep_guards_at(int k)
    {
        for (int i = 0; i < m; ++i) {
            guards_[k * m + i] = c_[tape.outputs[static_cast<std::size_t>(n + i)]][k];
        }
    }
    template <int... i>
    [[gnu::always_inline]] void end_guards([[maybe_unused]] int k, std::integer_sequence<int, i...>)
    {
        if constexpr (m > 0) {
            (end_op<i>(k), ...);
            keep_guards_at(k);
        }
    }
    template <int i>
    [[gnu::always_inline]] void end_op(int k)
    {
        if constexpr (tape.for_guards[static_cast<std::size_t>(i)]) compute_at<i>(k);
    }

    /// sum of a_j b_{k-j} for j from lo to hi
    [[nodiscard]] static double convolve(int k, int lo, int hi, const double* a, const double* b)
    {
        return hi < lo ? 0
                       : reversed_products[static_cast<std::size_t>(hi - lo)](a + lo, b + (k - lo));
    }
    [[nodiscard]] static double square(int k, int lo, const double* a)
    {
        const double twice = 2 * convolve(k, lo, (k - 1) / 2, a, a);
        return k % 2 == 0 && lo <= k / 2 ? twice + a[k / 2] * a[k / 2] : twice;
    }

    template <int i>
    [[gnu::always_inline]] void compute_at(int k)
    {
        if constexpr (i > n) c_[i][k] = coefficient_at<i>(k);
        if constexpr (has_slope<i>) {
            slope_[i][k] = k * c_[i][k];
        }
    }

    /// c g' = a' b - b' a
    template <int i>
    [[nodiscard, gnu::always_inline]] double angle_at(int k) const
    {
        constexpr TapeOp op = op_at(i);
        constexpr int a = larger(op.a, 0), b = larger(op.b, 0), c = larger(op.c, 0);
        const S turn =
            convolve(k, larger(1, k - degree(b)), smaller(degree(a), k), slope<a>(), c_[b]) -
            convolve(k, larger(1, k - degree(a)), smaller(degree(b), k), slope<b>(), c_[a]);
        const int from = larger(1, k - degree(c));
        return (turn - convolve(k, from, k - 1, slope<i>(), c_[c])) * inverse_[i] / k;
    }

    /// As `coefficient`; coefficients beyond a degree are zeros here.
    template <int i>
    [[nodiscard, gnu::always_inline]] double coefficient_at(int k) const
    {
        constexpr TapeOp op = op_at(i);
        constexpr int da = degree(larger(op.a, 0));
        constexpr int db = degree(larger(op.b, 0));
        const S* const a = c_[larger(op.a, 0)];
        const S* const b = c_[larger(op.b, 0)];
        const S* const own = c_[i];
        const int upto_a = smaller(da, k);
        const int upto_b = smaller(db, k);
        switch (op.op) {
            case TaylorOp::sum: return a[k] + b[k];
            case TaylorOp::difference: return a[k] - b[k];
            case TaylorOp::negative:
            case TaylorOp::constant_minus: return -a[k];
            case TaylorOp::plus_constant:
            case TaylorOp::minus_constant: return a[k];
            case TaylorOp::times_constant:
            case TaylorOp::over_constant: return constants_[i] * a[k];
            case TaylorOp::product: return convolve(k, larger(0, k - db), upto_a, a, b);
            case TaylorOp::square: return square(k, larger(0, k - da), a);
            case TaylorOp::quotient: return (a[k] - convolve(k, 1, upto_b, b, own)) * inverse_[i];
            case TaylorOp::constant_over: return convolve(k, 1, upto_a, a, own) * inverse_[i];
            case TaylorOp::square_root: return (a[k] - square(k, 1, own)) * inverse_[i];
            case TaylorOp::power:
            case TaylorOp::cube_root: {
                double sum = 0;
                const double each = (op.exponent + 1) / k;
                for (int j = 1; j <= upto_a; ++j) sum += (each * j - 1) * a[j] * own[k - j];
                return sum * inverse_[i];
            }
            case TaylorOp::exponential:
                return convolve(k, 1, upto_a, slope<larger(op.a, 0)>(), own) / k;
            case TaylorOp::sine:
            case TaylorOp::hyperbolic_sine:
            case TaylorOp::hyperbolic_cosine:
                return convolve(k, 1, upto_a, slope<larger(op.a, 0)>(), b) / k;
            case TaylorOp::cosine: return -convolve(k, 1, upto_a, slope<larger(op.a, 0)>(), b) / k;
            case TaylorOp::tangent:
                return a[k] + convolve(k, 1, upto_a, slope<larger(op.a, 0)>(), b) / k;
            case TaylorOp::hyperbolic_tangent:
                return a[k] - convolve(k, 1, upto_a, slope<larger(op.a, 0)>(), b) / k;
            case TaylorOp::logarithm:
                return (a[k] - convolve(k, larger(1, k - da), k - 1, slope<i>(), a) / k) *
                       inverse_[i];
            case TaylorOp::arc_sine:
            case TaylorOp::arc_tangent:
                return (a[k] - convolve(k, larger(1, k - db), k - 1, slope<i>(), b) / k) *
                       inverse_[i];
            case TaylorOp::arc_cosine:
                return (-a[k] - convolve(k, larger(1, k - db), k - 1, slope<i>(), b) / k) *
                       inverse_[i];
            case TaylorOp::angle: return angle_at<i>(k);
            case TaylorOp::input:
            case TaylorOp::constant: break;
        }
        return 0;
    }

    const S* constants_;
    S* guards_;
    // Unrolled, no coefficient is read that was not written.
    S c_[ops][most + 1];      // NOLINT(*-avoid-c-arrays): indices are int
    S slope_[ops][most + 1];  // NOLINT(*-avoid-c-arrays)
    S inverse_[ops];          // NOLINT(*-avoid-c-arrays)
};

}  // namespace ricochet::detail
