// Whole steps for states that do not fit the registers.
//
// Such a step is bound by memory traffic: each stage is one pass over its
// operands, which also turns the rate of the previous stage into a departure, and everything
// that is computed at the end of a step is computed in one pass. The end and its rounding error
// lie in arrays of their own, which the acceptance of a step only exchanges.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "base/wide.hpp"
#include "ricochet/detail/runge_kutta.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/instant.hpp"

namespace ricochet::detail {

template <class Tableau>
class LargeKernel {
    using X = std::vector<double>;
    using State = StepState<X>;
    using Method = RungeKutta<Tableau, X>;
    static constexpr std::size_t last = Method::kept_stages;  ///< the stage that is kept

    /// Four doubles, in one register or in two, by the instruction set. A function that returns
    /// them does so in another place where it is compiled for AVX2: each has to be inlined.
    typedef double Four __attribute__((vector_size(32)));

    /// Writes dx/ds at offset s and state `step.at` into `rate`.
    [[gnu::always_inline]] static void flow(void* adapter, State& step, double s, X& rate)
    {
        ++step.flow_calls;
        step.flow_fits &= step.flow(adapter, step.mode, step.flow_time(s), step.at, rate);
        if (step.backward) {
            for (double& each : rate) each = -each;
        }
    }

    /// Computes w of a row and the state there, at offset s. The rate of stage `raw`, unless
    /// `raw` is 0, is still that of the flow.
    template <class Row, std::size_t raw, bool keeps>
    RICOCHET_WIDE static void combine(State& step, double h, double s, X* kept, X& w)
    {
        const std::size_t n = step.x0.size();
        const auto weights = Method::template weights_of<Row>(h);
        const double* const x0 = step.x0.data();
        const double* const rate0 = step.rate0.data();
        double* const at = step.at.data();
        double* const sum = w.data();
        std::array<double*, last + 1> k{};
        for (std::size_t j = 0; j < last; ++j) k[j + 1] = kept[j].data();
        RICOCHET_NO_DEPENDENCE
        for (std::size_t i = 0; i < n; ++i) {
            [[maybe_unused]] double newest = 0, departing = 0;
            if constexpr (raw > 0) {
                newest = k[raw][i];
                departing = newest - rate0[i];
                k[raw][i] = departing;
            }
            const auto rate = [&](auto j) __attribute__((always_inline))
            {
                if constexpr (j == raw) {
                    return departing;
                } else {
                    return k[j][i];
                }
            };
            if constexpr (Method::template ends_with<Row, raw>) {
                constexpr std::size_t before = Method::template terms<Row> - 1;
                double older = 0;
                if constexpr (before > 0) {
                    older = Method::template sum_of<Row, before>(weights, rate);
                }
                at[i] = Method::template state_of<Row>({x0[i], rate0[i]}, s, weights[before], older,
                                                       newest);
                if constexpr (keeps) sum[i] = Method::template sum_of<Row>(weights, rate);
            } else {
                double bent = 0;
                if constexpr (Method::template terms < Row >> 0) {
                    bent = Method::template sum_of<Row>(weights, rate);
                }
                if constexpr (keeps) sum[i] = bent;
                at[i] = x0[i] + (s * rate0[i] + bent);
            }
        }
    }

    template <std::size_t... I>
    static void take_stages([[maybe_unused]] void* adapter, [[maybe_unused]] State& step,
                            [[maybe_unused]] double h, [[maybe_unused]] X* k,
                            std::index_sequence<I...>)
    {
        ((combine<typename Method::template Stage<I + 1>, I, false>(step, h, h * Tableau::c[I + 1],
                                                                    k, step.at),
          flow(adapter, step, h * Tableau::c[I + 1], k[I])),
         ...);
    }

    /// w after a step of length h, from stages that are kept in `k`.
    static void depart(void* adapter, State& step, double h, X* k, X& w)
    {
        for (std::size_t i = 0; i < last; ++i) {
            if (k[i].size() != step.x0.size()) k[i] = step.zero;
        }
        take_stages(adapter, step, h, k, std::make_index_sequence<last>{});
        combine<typename Method::Weights, last, true>(step, h, h, k, w);
    }

    template <class V>
    [[nodiscard, gnu::always_inline]] static V load(const double* from) noexcept
    {
        V value;
        std::memcpy(&value, from, sizeof value);
        return value;
    }
    template <class V>
    [[gnu::always_inline]] static void store(double* to, const V& value) noexcept
    {
        std::memcpy(to, &value, sizeof value);
    }
    [[nodiscard, gnu::always_inline]] static double magnitude(double x) noexcept
    {
        return std::fabs(x);
    }
    [[nodiscard, gnu::always_inline]] static Four magnitude(const Four& x) noexcept
    {
        typedef std::int64_t Bits __attribute__((vector_size(32)));
        const Bits all_but_sign = Bits{} + std::numeric_limits<std::int64_t>::max();
        return reinterpret_cast<Four>(reinterpret_cast<Bits>(x) & all_but_sign);
    }

    [[nodiscard, gnu::always_inline]] static bool any_zero(double x) noexcept { return x == 0; }
    [[nodiscard, gnu::always_inline]] static bool any_zero(const Four& x) noexcept
    {
        return x[0] == 0 || x[1] == 0 || x[2] == 0 || x[3] == 0;
    }

    template <bool with_error>
    [[nodiscard, gnu::always_inline]] static auto error_weights([[maybe_unused]] double h) noexcept
    {
        if constexpr (with_error) {
            return Method::template weights_of<typename Method::Errors>(h);
        } else {
            return 0;
        }
    }

    /// One pass over the components of a step that has been taken: its end, the rates there, and
    /// the largest ratio of error.
    template <bool with_error>
    struct Pass {
        Pass(State& step, double length, double relative, double absolute)
            : x0(step.x0.data()),
              rate0(step.rate0.data()),
              w(step.w.data()),
              remainder(step.remainder.data()),
              w_rate(step.w_rate1.data()),
              x1(step.x1.data()),
              rate1(step.rate1.data()),
              remainder1(step.large.remainder1.data()),
              each(step.component_atol),
              h(length),
              rtol(relative),
              atol(absolute),
              weights(error_weights<with_error>(length))
        {
            for (std::size_t j = 0; j < last; ++j) k[j] = step.stages[j].data();
        }

        /// Components i to i + 3, or i alone.
        template <class V>
        [[gnu::always_inline]] void operator()(std::size_t i, V& worst, V& lost) const
        {
            const V start = load<V>(x0 + i);
            const V rate = load<V>(rate0 + i);
            const V change = h * rate + (load<V>(w + i) + load<V>(remainder + i));
            const V end = start + change;
            const V moved = end - start;  // Knuth's two-sum
            store<V>(x1 + i, end);
            store<V>(remainder1 + i, (start - (end - moved)) + (change - moved));
            V rate_there;
            V departing{};
            if constexpr (Method::fsal) {
                departing = load<V>(w_rate + i) - rate;
                store<V>(w_rate + i, departing);
                rate_there = rate + departing;
                store<V>(rate1 + i, rate_there);
            } else {
                rate_there = load<V>(rate1 + i);
            }
            lost += 0 * end + 0 * rate_there;  // NaN if one of them is not finite
            if constexpr (with_error) {
                const V ratio = ratio_of(i, start, end, departing);
                worst = ratio > worst ? ratio : worst;
                lost += 0 * ratio;
            }
        }

        template <class V>
        [[nodiscard, gnu::always_inline]] V ratio_of(std::size_t i, const V& start, const V& end,
                                                     const V& departing) const
        {
            const auto rates = [&](auto j) __attribute__((always_inline))
            {
                if constexpr (j <= last) {
                    return load<V>(k[j - 1] + i);
                } else {
                    return departing;
                }
            };
            V error = magnitude(Method::template sum_of<typename Method::Errors>(weights, rates));
            if constexpr (Method::estimates_quadrature) {
                if (any_zero(error)) {
                    using Row = typename Method::QuadratureErrors;
                    const auto others = Method::template weights_of<Row>(h);
                    const V other = magnitude(Method::template sum_of<Row>(others, rates));
                    constexpr auto twins = Method::Coefficients::twins;
                    const V apart = load<V>(k[twins[0] - 1] + i) - load<V>(k[twins[1] - 1] + i);
                    error = error + magnitude(apart) == 0 ? other : error;
                }
            }
            const V size0 = magnitude(start);
            const V size1 = magnitude(end);
            const V at_zero = each ? load<V>(each + i) : V{} + atol;
            V allowed = at_zero + rtol * (size0 > size1 ? size0 : size1);
            allowed = allowed < least_tolerance ? V{} + least_tolerance : allowed;
            return error * (1 / allowed);
        }

        const double* x0;
        const double* rate0;
        const double* w;
        const double* remainder;
        double* w_rate;
        double* x1;
        double* rate1;
        double* remainder1;
        const double* each;
        double h, rtol, atol;
        std::array<const double*, last + 1> k{};
        decltype(error_weights<with_error>(0.0)) weights;
    };

    /// Takes a step. Returns the largest ratio of error, 0 without an estimate; NaN if not finite.
    template <bool with_error>
    RICOCHET_WIDE static double go(void* adapter, State& step, double h, double rtol, double atol)
    {
        step.h = h;
        step.has_middle = false;
        step.asked_alone = 0;
        depart(adapter, step, h, step.stages.data(), step.w);
        if constexpr (Method::fsal) flow(adapter, step, h, step.w_rate1);
        const std::size_t n = step.x0.size();
        if constexpr (!Method::fsal) {
            for (std::size_t i = 0; i < n; ++i) {
                step.at[i] = step.x0[i] + (h * step.rate0[i] + (step.w[i] + step.remainder[i]));
            }
            flow(adapter, step, h, step.rate1);
        }
        const Pass<with_error> some(step, h, rtol, atol);
        Four worst{};
        Four lost{};
        std::size_t i = 0;
        for (; i + 4 <= n; i += 4) some(i, worst, lost);
        double last_worst = std::max(std::max(worst[0], worst[1]), std::max(worst[2], worst[3]));
        double last_lost = (lost[0] + lost[1]) + (lost[2] + lost[3]);
        for (; i < n; ++i) some(i, last_worst, last_lost);
        return last_lost == 0 ? last_worst : std::numeric_limits<double>::quiet_NaN();
    }

    static bool take(void* adapter, State& step, double h)
    {
        const double ratio = go<false>(adapter, step, h, 0, 0);
        return ratio == ratio;
    }

    static double attempt(void* adapter, State& step, double h, double rtol, double atol)
    {
        return go<true>(adapter, step, h, rtol, atol);
    }

    static void depart_only(void* adapter, State& step, double s, X& w, X& rate)
    {
        depart(adapter, step, s, step.large.probed.data(), w);
        if constexpr (Method::fsal) {
            flow(adapter, step, s, rate);
            for (std::size_t i = 0; i < rate.size(); ++i) rate[i] -= step.rate0[i];
        }
    }

public:
    [[nodiscard]] static StepKernel<X> make()
    {
        StepKernel<X> kernel;
        kernel.order = Method::order_value;
        kernel.error_order = Method::error_order_value;
        kernel.end_rate = Method::fsal;
        kernel.is_dopri5 = Method::has_dense_output;
        kernel.take = &take;
        kernel.depart = &depart_only;
        if constexpr (Method::estimates_error) kernel.attempt = &attempt;
        return kernel;
    }
};

}  // namespace ricochet::detail
