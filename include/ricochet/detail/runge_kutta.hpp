// Internal: the declarations of this header may change without notice.
//
// Explicit Runge-Kutta methods, as departures from the tangent.
//
// With x(t0 + s) = x0 + s f0 + w(s) the first stage of w vanishes, and so does its start:
// a tableau reduces to its stages from the second on. The sums are formed in the
// order of Boost.Odeint's steppers; terms whose coefficient is zero are omitted. Only the state at
// which the flow is evaluated next adds the newest rate last, since every stage waits for it:
//
//     x0 + ((older + (s - b) f0) + b f),    w(s) = older + b (f - f0)
//
// with f the newest rate, b its weight and `older` the terms of the rates before it. The steps are
// those of odeint's steppers to rounding.
//
// Tableaus: Dormand and Prince, J. Comput. Appl. Math. 6 (1980) 19-26; Cash and Karp, ACM
// Trans. Math. Softw. 16 (1990) 201-222; Fehlberg, NASA TR R-287 (1968).
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "ricochet/detail/components.hpp"

namespace ricochet::detail {

struct EulerTableau {
    static constexpr int order = 1;
    static constexpr std::size_t stages = 1;
    static constexpr std::array<double, 1> c = {0};
    static constexpr std::array<std::array<double, 1>, 1> a = {};
    static constexpr std::array<double, 1> b = {1};
};

struct Rk4Tableau {
    static constexpr int order = 4;
    static constexpr std::size_t stages = 4;
    using Row = std::array<double, 4>;
    static constexpr Row c = {0, 0.5, 0.5, 1};
    static constexpr std::array<Row, 4> a = {{{}, {0.5}, {0, 0.5}, {0, 0, 1}}};
    static constexpr Row b = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
    /// h / 3 is not h * (1 / 3): the weights divide, as in odeint.
    static constexpr Row b_divisors = {6, 3, 3, 6};
};

struct CashKarp54Tableau {
    static constexpr int order = 5;
    static constexpr int error_order = 4;
    static constexpr std::size_t stages = 6;
    using Row = std::array<double, 6>;
    static constexpr Row c = {0, 1.0 / 5, 3.0 / 10, 3.0 / 5, 1, 7.0 / 8};
    static constexpr std::array<Row, 6> a = {
        {{},
         {1.0 / 5},
         {3.0 / 40, 9.0 / 40},
         {3.0 / 10, -9.0 / 10, 6.0 / 5},
         {-11.0 / 54, 5.0 / 2, -70.0 / 27, 35.0 / 27},
         {1631.0 / 55296, 175.0 / 512, 575.0 / 13824, 44275.0 / 110592, 253.0 / 4096}}};
    static constexpr Row b = {37.0 / 378, 0, 250.0 / 621, 125.0 / 594, 0, 512.0 / 1771};
    static constexpr Row error = {b[0] - 2825.0 / 27648,  0,
                                  b[2] - 18575.0 / 48384, b[3] - 13525.0 / 55296,
                                  -277.0 / 14336,         b[5] - 1.0 / 4};
};

struct Dopri5Tableau {
    static constexpr int order = 5;
    static constexpr int error_order = 4;
    static constexpr std::size_t stages = 6;
    using Row = std::array<double, 6>;
    static constexpr Row c = {0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1};
    static constexpr std::array<Row, 6> a = {
        {{},
         {1.0 / 5},
         {3.0 / 40, 9.0 / 40},
         {44.0 / 45, -56.0 / 15, 32.0 / 9},
         {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
         {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656}}};
    static constexpr Row b = {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84};
    /// The last entry belongs to the rate at the end of the step (first same as last).
    static constexpr std::array<double, 7> error = {b[0] - 5179.0 / 57600,
                                                    0,
                                                    b[2] - 7571.0 / 16695,
                                                    b[3] - 393.0 / 640,
                                                    b[4] - -92097.0 / 339200,
                                                    b[5] - 187.0 / 2100,
                                                    -1.0 / 40};

    /// Weights of the rates in w(theta h) / h, of order 4 (Shampine, Math. Comp. 46 (1986)
    /// 135-150; Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd
    /// ed., section II.6).
    static constexpr std::array<double, 7> dense(double theta)
    {
        const double left = theta - 1;
        const double square = theta * theta;
        const double value = square * (3 - 2 * theta);
        const double slope = square * left;
        const double bump = square * left * left;
        const double x3 = 100 * (882725551 - 15701508 * theta) / 32700410799;
        const double x4 = 25 * (443332067 - 31403016 * theta) / 1880347072;
        const double x5 = 32805 * (23143187 - 3489224 * theta) / 199316789632;
        const double x6 = 55 * (29972135 - 7076736 * theta) / 822651844;
        const double x7 = 10 * (7414447 - 829305 * theta) / 29380423;
        return {0,
                0,
                value * b[2] + bump * x3,
                value * b[3] - bump * x4,
                value * b[4] + bump * x5,
                value * b[5] - bump * x6,
                slope + bump * x7};
    }
};

struct Fehlberg78Tableau {
    static constexpr int order = 8;
    static constexpr int error_order = 7;
    static constexpr std::size_t stages = 13;
    using Row = std::array<double, 13>;
    static constexpr Row c = {0,       2.0 / 27, 1.0 / 9, 1.0 / 6, 5.0 / 12, 1.0 / 2, 5.0 / 6,
                              1.0 / 6, 2.0 / 3,  1.0 / 3, 1,       0,        1};
    static constexpr std::array<Row, 13> a = {
        {{},
         {2.0 / 27},
         {1.0 / 36, 1.0 / 12},
         {1.0 / 24, 0, 1.0 / 8},
         {5.0 / 12, 0, -25.0 / 16, 25.0 / 16},
         {1.0 / 20, 0, 0, 1.0 / 4, 1.0 / 5},
         {-25.0 / 108, 0, 0, 125.0 / 108, -65.0 / 27, 125.0 / 54},
         {31.0 / 300, 0, 0, 0, 61.0 / 225, -2.0 / 9, 13.0 / 900},
         {2, 0, 0, -53.0 / 6, 704.0 / 45, -107.0 / 9, 67.0 / 90, 3},
         {-91.0 / 108, 0, 0, 23.0 / 108, -976.0 / 135, 311.0 / 54, -19.0 / 60, 17.0 / 6, -1.0 / 12},
         {2383.0 / 4100, 0, 0, -341.0 / 164, 4496.0 / 1025, -301.0 / 82, 2133.0 / 4100, 45.0 / 82,
          45.0 / 164, 18.0 / 41},
         {3.0 / 205, 0, 0, 0, 0, -6.0 / 41, -3.0 / 205, -3.0 / 41, 3.0 / 41, 6.0 / 41},
         {-1777.0 / 4100, 0, 0, -341.0 / 164, 4496.0 / 1025, -289.0 / 82, 2193.0 / 4100, 51.0 / 82,
          33.0 / 164, 12.0 / 41, 0, 1}}};
    static constexpr Row b = {0,        0,         0,         0, 0,          34.0 / 105, 9.0 / 35,
                              9.0 / 35, 9.0 / 280, 9.0 / 280, 0, 41.0 / 840, 41.0 / 840};
    static constexpr Row error = {-41.0 / 840, 0, 0, 0,           0,          0,         0,
                                  0,           0, 0, -41.0 / 840, 41.0 / 840, 41.0 / 840};
    /// Two stages at one time. Their rates are equal where these depend on time alone.
    static constexpr std::array<std::size_t, 2> twins = {3, 7};
    /// The stages of `error` are taken at both ends of the step, and cancel there. The weights less
    /// those of the symmetric rule of order 6 with the nodes 0, 1/6, 1/2, 5/6 and 1 take its place:
    /// 3/1400 of the sixth difference of the rates.
    static constexpr Row quadrature_error = {0,
                                             0,
                                             0,
                                             0,
                                             0,
                                             -60.0 / 1400,
                                             -18.0 / 1400,
                                             -18.0 / 1400,
                                             45.0 / 1400,
                                             45.0 / 1400,
                                             0,
                                             3.0 / 1400,
                                             3.0 / 1400};
};

/// Offset of a stage in its step, of which the compiler knows whether it is an end.
template <bool is_end>
struct StageOffset {
    double s;  ///< [s]
    constexpr operator double() const noexcept { return s; }
};

/// What a step of a method computes: the departure w, its rate at the end, and the error estimate,
/// the latter two where the method has them.
template <class X>
struct StepDeparture {
    X& w;
    X& rate;
    X& error;
};

/// One explicit method for states of type X. The caller stores the rates of its stages from the
/// second on, `k[0]` to `k[kept_stages - 1]`.
template <class Tableau, class X>
class RungeKutta {
public:
    using Coefficients = Tableau;
    static constexpr int order_value = Tableau::order;
    static constexpr std::size_t kept_stages = Tableau::stages - 1;
    /// Whether the tableau has an embedded error estimate.
    static constexpr bool estimates_error = requires { Tableau::error; };
    /// Whether another estimate takes its place where the rate depends on time alone.
    static constexpr bool estimates_quadrature = requires { Tableau::quadrature_error; };
    /// Whether the estimate uses the rate at the end of the step (first same as last).
    static constexpr bool fsal = [] {
        if constexpr (requires { Tableau::error; }) {
            return Tableau::error.size() > Tableau::stages;
        }
        return false;
    }();
    static constexpr int error_order_value = [] {
        if constexpr (requires { Tableau::error_order; }) return Tableau::error_order;
        return 0;
    }();
    static constexpr bool has_dense_output = requires { Tableau::dense(0.5); };

    static constexpr std::make_index_sequence<kept_stages> inner_stages{};

    // In these functions a level of calls, be it of a lambda, is one more copy of a whole step that
    // the compiler has to optimise. Hence the sequences among the parameters.

    /// w(h) from the flow of the departures, `flow(w, w_rate, offset)`. If the method is FSAL, the
    /// rate at the end is computed too; `with_error`: so is the error estimate. `like` gives the
    /// size of a state that is sized at run time.
    template <class Flow, std::size_t... I>
    [[gnu::always_inline]] static void depart(const Flow& flow, [[maybe_unused]] const X& like,
                                              double h, X* k, const StepDeparture<X>& to,
                                              [[maybe_unused]] bool with_error,
                                              std::index_sequence<I...> /*inner_stages*/)
    {
        if constexpr (fixed_size<X>() == 0) {
            for (std::size_t i = 0; i < kept_stages; ++i) {
                if (k[i].size() != like.size()) k[i] = like;
            }
        }
        (flow(RowView<Stage<I + 1>, I>(h, k), k[I], offset_of<I + 1>(h)), ...);
        combine<Weights>(h, k, to.rate, to.w);
        if constexpr (fsal) {
            flow(RowView<Weights, kept_stages>(h, k), to.rate, StageOffset<true>{h});
        }
        if constexpr (estimates_error) {
            if (with_error) estimate(h, k, to.rate, to.error);
        }
    }

    /// Number of weights of the rates in w on the dense output.
    static constexpr std::size_t dense_weights_count = Tableau::stages + 1;

    /// w(s) on the dense output of the step of length h; `rate` is the rate of the departures at
    /// the end.
    static void dense(double s, double h, const X* k, const X& rate, X& w) requires has_dense_output
    {
        auto weights = Tableau::dense(s / h);
        for (double& weight : weights) weight *= h;
        for_each_component(
            w, [&](auto c) __attribute__((always_inline)) { w[c] = dense(weights, k, rate, c); });
    }

    /// Weights of the rates in w at the fraction `Part::u` of a step of length h.
    template <class Part>
    [[nodiscard, gnu::always_inline]] static constexpr auto weights(double h) noexcept requires
        has_dense_output
    {
        constexpr auto unit = Tableau::dense(Part::u);
        auto weights = unit;
        for (double& weight : weights) weight *= h;
        return weights;
    }

    /// One component of w on the dense output, from the weights of the rates.
    template <class Array, class Index>
    [[nodiscard, gnu::always_inline]] static double dense(const Array& weights, const X* k,
                                                          const X& rate, Index c)
    {
        return dense(weights, k, rate, c, all_used<Weights>);
    }
    template <class Array, class Index, std::size_t... I>
    [[nodiscard, gnu::always_inline]] static double dense(const Array& weights, const X* k,
                                                          const X& rate, Index c,
                                                          std::index_sequence<I...> /*all_used*/)
    {
        return (... + (weights[used<Weights>.at[I]] * k[used<Weights>.at[I] - 1][c])) +
               weights[Tableau::stages] * rate[c];
    }

    template <std::size_t i>
    struct Stage {
        static constexpr auto coefficients = Tableau::a[i];
        static constexpr double node = Tableau::c[i];
        static constexpr double times(double h, std::size_t j) { return h * coefficients[j]; }
    };
    struct Weights {
        static constexpr auto coefficients = Tableau::b;
        static constexpr double node = 1;
        static constexpr double times(double h, std::size_t j)
        {
            if constexpr (requires { Tableau::b_divisors; }) return h / Tableau::b_divisors[j];
            return h * coefficients[j];
        }
    };
    struct Errors {
        static constexpr auto coefficients = Tableau::error;
        static constexpr double times(double h, std::size_t j) { return h * coefficients[j]; }
    };

    struct QuadratureErrors {
        static constexpr auto coefficients = Tableau::quadrature_error;
        static constexpr double times(double h, std::size_t j) { return h * coefficients[j]; }
    };

    /// The stages from the second on that a row of the tableau uses.
    template <class Row>
    static constexpr auto used = [] {
        struct {
            std::array<std::size_t, Row::coefficients.size()> at{};
            std::size_t count = 0;
        } found;
        for (std::size_t j = 1; j < Row::coefficients.size(); ++j) {
            if (Row::coefficients[j] != 0) found.at[found.count++] = j;
        }
        return found;
    }();

    template <class Row>
    static constexpr std::size_t terms = used<Row>.count;
    template <class Row>
    static constexpr std::make_index_sequence<terms<Row>> all_used{};

    /// Factors of a row's rates in a step of length h.
    template <class Row>
    [[nodiscard, gnu::always_inline]] static auto weights_of(double h) noexcept
    {
        constexpr std::size_t terms = used<Row>.count;
        std::array<double, terms + 1> weights{};
        for (std::size_t j = 0; j < terms; ++j) weights[j] = Row::times(h, used<Row>.at[j]);
        return weights;
    }

    /// The sum of the first `count` terms of a row, of which there is at least one; `rate(j)` is
    /// the rate of stage j, with j an integral constant.
    template <class Row, std::size_t count = used<Row>.count, class Array, class Rate>
    [[nodiscard, gnu::always_inline]] static auto sum_of(const Array& weights, const Rate& rate)
    {
        return [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline))
        {
            return (... +
                    (weights[I] * rate(std::integral_constant<std::size_t, used<Row>.at[I]>{})));
        }
        (std::make_index_sequence<count>{});
    }

    /// Whether the last rate that a row uses is that of stage `newest`.
    template <class Row, std::size_t newest>
    static constexpr bool ends_with = [] {
        constexpr std::size_t count = used<Row>.count;
        return newest > 0 && count > 0 && used<Row>.at[count > 0 ? count - 1 : 0] == newest;
    }();

    /// A component of the start of a step, and of the rate there.
    struct AtStart {
        double x, rate;
    };

    /// The state at offset s of a row that ends with the newest stage, whose rate is that of the
    /// flow itself, `newest`.
    ///
    /// @param weight  of the newest rate
    /// @param older   sum of the terms before
    template <class Row>
    [[nodiscard, gnu::always_inline]] static double state_of(const AtStart& start, double s,
                                                             double weight, double older,
                                                             double newest)
    {
        constexpr std::size_t before = used<Row>.count - 1;
        const double last = weight * newest;
        if constexpr (before > 0) {
            return start.x + ((older + (s - weight) * start.rate) + last);
        } else if constexpr (Row::coefficients[used<Row>.at[0]] != Row::node) {
            return start.x + ((s - weight) * start.rate + last);
        } else {
            return start.x + last;  // s is the weight
        }
    }

    /// The sum of the first terms of a row in a step of length h, for one component: of the rates
    /// in `k`, and `rate` at the end. 0 without terms.
    template <class Row, class Index, std::size_t... I>
    [[nodiscard, gnu::always_inline]] static double sum([[maybe_unused]] double h,
                                                        [[maybe_unused]] const X* k,
                                                        [[maybe_unused]] const X& rate,
                                                        [[maybe_unused]] Index c,
                                                        std::index_sequence<I...>)
    {
        if constexpr (sizeof...(I) == 0) {
            return 0;
        } else {
            return (... + (Row::times(h, used<Row>.at[I]) *
                           (used<Row>.at[I] <= kept_stages ? k[used<Row>.at[I] - 1] : rate)[c]));
        }
    }

private:
    /// The departure at which the flow is evaluated after stage `newest`, one component at a time.
    /// Where the row ends with that stage its term is apart.
    template <class Row, std::size_t newest>
    class RowView {
        static constexpr bool split = ends_with<Row, newest>;

    public:
        [[gnu::always_inline]] RowView(double h, const X* k) noexcept : k_(k), h_(h) {}
        template <class Index>
        [[nodiscard, gnu::always_inline]] double operator[](Index c) const
        {
            return sum<Row>(h_, k_, k_[0], c, all_used<Row>);
        }
        /// The state at offset s.
        template <class Index>
        [[nodiscard, gnu::always_inline]] double state(Index c, const AtStart& start, double s,
                                                       double rate) const requires split
        {
            constexpr std::size_t before = terms<Row> - 1;
            return state_of<Row>(start, s, Row::times(h_, newest),
                                 sum<Row>(h_, k_, k_[0], c, std::make_index_sequence<before>{}),
                                 rate);
        }

    private:
        const X* k_;
        double h_;
    };

    template <std::size_t i>
    [[nodiscard, gnu::always_inline]] static constexpr auto offset_of(double h) noexcept
    {
        constexpr bool is_end = Tableau::c[i] == 0 || Tableau::c[i] == 1;
        return StageOffset<is_end>{h * Tableau::c[i]};
    }

    template <class Index>
    [[nodiscard, gnu::always_inline]] static bool are_twins(const X* k, Index c)
    {
        return k[Tableau::twins[0] - 1][c] == k[Tableau::twins[1] - 1][c];
    }

    [[gnu::always_inline]] static void estimate(double h, const X* k, const X& rate, X& error)
    {
        combine<Errors>(h, k, rate, error);
        if constexpr (estimates_quadrature) {
            double product = 1;  // zero if one of them is zero, or if it underflows
            for_each_component(
                error, [&](auto c) __attribute__((always_inline)) { product *= error[c]; });
            if (product != 0) [[likely]]
                return;
            for_each_component(
                error, [&](auto c) __attribute__((always_inline)) {
                    if (error[c] != 0 || !are_twins(k, c)) return;
                    error[c] = sum<QuadratureErrors>(h, k, rate, c, all_used<QuadratureErrors>);
                });
        }
    }

    template <class Row>
    [[gnu::always_inline]] static void combine(double h, const X* k, const X& rate, X& w)
    {
        for_each_component(
            w, [&](auto c) __attribute__((always_inline)) {
                w[c] = sum<Row>(h, k, rate, c, all_used<Row>);
            });
    }
};

/// Number of stages of the method that has the most.
inline constexpr std::size_t most_kept_stages = Fehlberg78Tableau::stages - 1;

}  // namespace ricochet::detail
