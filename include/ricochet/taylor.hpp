// Taylor series as a method: of high order, without stages, each step a polynomial in time.
//
//     #include "ricochet/taylor.hpp"
//     integrate(system, x0, {.t_end = 100, .rtol = 1e-12}, ErrorControlled<Taylor>{});
//
// The flow is a template over its scalar that a constant expression can evaluate, with the state as
// an array, and functions called by their bare names:
//
//     template <class S>
//     constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
//     {
//         using std::cos;
//         dxdt[0] = x[1];
//         dxdt[1] = cos(frequency * t) - x[0];
//     }
//
// It may use + - * / sqrt cbrt pow exp log sin cos tan asin acos atan sinh cosh tanh hypot, and
// must be the same operations whatever the values are: no comparisons, no kinks. A system with
// modes takes the mode first, and its `mode_count` is a constant. The system has a constexpr
// default constructor; the parameters of the object are those of the run.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "ricochet/detail/kernels.hpp"
#include "ricochet/detail/taylor_series.hpp"
#include "ricochet/detail/taylor_tape.hpp"
#include "ricochet/hybrid/system.hpp"

namespace ricochet {

/// Taylor's method. The length of a step is known before it is taken, from its last two
/// coefficients (Jorba and Zou, Experimental Mathematics 14, 2005, section 3.2), so that no step is
/// rejected; the polynomial is the dense output and, at other lengths, the step itself.
struct Taylor {
    /// 12, 16 or 20. 0: by `Options::rtol`, 12 from 1e-8 upward, 16 from 1e-11, else 20; with fixed
    /// steps 20.
    int order = 0;

    template <class State>
    struct Stepper {
        static constexpr bool estimates_error = true;
        static constexpr bool fsal = true;
        static constexpr bool has_dense_output = true;
    };
};

namespace detail {

inline constexpr int most_taylor_order = 20;

[[nodiscard]] constexpr int taylor_order(int given, double rtol) noexcept
{
    if (given != 0) return given;
    return rtol >= 1e-8 ? 12 : rtol >= 1e-11 ? 16 : 20;
}

/// log2 of a positive normal number, to 1e-3: a step from its twelfth part is right to 1e-4.
[[nodiscard]] inline double rough_log2(double x) noexcept
{
    const auto bits = std::bit_cast<std::uint64_t>(x);
    const auto exponent = static_cast<double>(static_cast<std::int64_t>(bits >> 52) - 1023);
    const double m =
        std::bit_cast<double>((bits & 0xfffffffffffffULL) | 0x3ff0000000000000ULL);  // in [1, 2)
    // Through log2 at the four Chebyshev nodes of [1, 2].
    return (exponent - 2.1362320654130670) +
           m * ((3.0111621508367876 - 1.0268049073983060 * m) + 0.1527002847975194 * (m * m));
}

/// 2^x for |x| < 1000, to 1e-4.
[[nodiscard]] inline double rough_exp2(double x) noexcept
{
    constexpr double shift = 0x1.8p52;  // rounds to a whole number
    const double whole = (x + shift) - shift;
    const double y = x - whole;
    // Through 2^y at the four Chebyshev nodes of [-1/2, 1/2].
    const double part = (0.9999245569508709 + 0.6931367338836214 * y) +
                        y * y * (0.2426394785462585 + 0.0558382829462201 * y);
    return part * std::bit_cast<double>(
                      static_cast<std::uint64_t>(static_cast<std::int64_t>(whole) + 1023) << 52);
}

/// The coefficients of the step in hand, and what they were computed from.
template <std::size_t n, std::size_t m>
struct TaylorStep {
    alignas(16) std::array<double, (most_taylor_order + 1) * n> coefficients{};
    std::array<double, (most_taylor_order + 1) * m> guards{};
    std::array<double, n> x{};
    Instant start;
    Mode mode = 0;
    bool backward = false;
    int order = 0;
    double reach = std::numeric_limits<double>::quiet_NaN();  ///< [s]; see `StepKernel::reach`
};

/// w(s) = sum of coefficients k of degree 2 and more, and its derivative.
template <bool with_rate, std::size_t n>
[[gnu::always_inline]] inline void evaluate_departure(const double* c, int order, double s,
                                                      std::array<double, n>& w,
                                                      std::array<double, n>& rate)
{
    // Four coefficients at a time: a quarter of Horner's additions wait for each other.
    const double s2 = s * s;
    const double s4 = s2 * s2;
    const auto at = [c](int k, std::size_t i) { return c[static_cast<std::size_t>(k) * n + i]; };
    for (std::size_t i = 0; i < n; ++i) w[i] = at(order, i);
    if constexpr (with_rate) rate.fill(0);
    for (int k = order - 4; k > 0; k -= 4) {
        for (std::size_t i = 0; i < n; ++i) {
            w[i] = w[i] * s4 +
                   ((at(k, i) + s * at(k + 1, i)) + s2 * (at(k + 2, i) + s * at(k + 3, i)));
        }
        if constexpr (with_rate) {
            const double d = k;
            for (std::size_t i = 0; i < n; ++i) {
                rate[i] =
                    rate[i] * s4 + (((d + 1) * at(k + 1, i) + s * ((d + 2) * at(k + 2, i))) +
                                    s2 * ((d + 3) * at(k + 3, i) + s * ((d + 4) * at(k + 4, i))));
            }
        }
    }
    for (std::size_t i = 0; i < n; ++i) w[i] = w[i] * s4 + s2 * (at(2, i) + s * at(3, i));
    if constexpr (with_rate) {
        for (std::size_t i = 0; i < n; ++i) {
            rate[i] =
                rate[i] * s4 + (s * (2 * at(2, i)) + s2 * (3 * at(3, i) + s * (4 * at(4, i))));
        }
    }
}

[[noreturn]] inline void throw_structure_differs(const std::string& name)
{
    throw std::invalid_argument(
        name +
        ": the operations of the flow differ from those of an object that is constructed by "
        "default; write them so that they do not depend on parameters, or use another "
        "method, such as Fehlberg78");
}
[[noreturn]] inline void throw_constant_not_finite(const std::string& name)
{
    throw std::invalid_argument(name + ": a constant of the flow is not finite");
}
[[noreturn]] inline void throw_bad_taylor_order(int order)
{
    throw std::invalid_argument("Taylor: order must be 12, 16 or 20, or 0, got " +
                                std::to_string(order));
}

/// How many tapes a flow has: one for each mode.
template <class System, std::size_t n>
[[nodiscard]] constexpr std::size_t tape_count() noexcept
{
    if constexpr (ModedScalarFlow<System, n>) {
        static_assert(
            requires { std::integral_constant<std::size_t, System::mode_count>{}; },
            "ricochet: found a flow with modes for Taylor, and no constant number of them; "
            "expected static constexpr std::size_t mode_count");
        return System::mode_count;
    } else {
        return 1;
    }
}

/// A door with the constants of the flow and the step in hand.
template <class System, class X>
struct StepperDoor<System, X, Taylor> : Door<System, X> {
    static constexpr std::size_t n = fixed_size<X>();
    /// Guards with series of their own.
    static constexpr std::size_t m = series_guards<System, n>();
    static constexpr bool takes_series = [] {
        static_assert(n > 0,
                      "ricochet: found a state sized at run time for Taylor; expected "
                      "std::array");
        constexpr bool callable = ScalarFlow<System, n> || ModedScalarFlow<System, n>;
        static_assert(
            callable,
            "ricochet: found no flow that takes Taylor series; expected template <class S> "
            "constexpr void flow([Mode,] const S& t, const std::array<S, n>& x, "
            "std::array<S, n>& dxdt) const");
        if constexpr (callable) {
            static_assert(std::is_default_constructible_v<System>,
                          "ricochet: found a system without a default constructor for Taylor; "
                          "expected a constexpr one, from which the operations of the flow are "
                          "read");
            static_assert(RecordableFlow<System, n>,
                          "ricochet: found a flow that no constant expression can evaluate; "
                          "expected constexpr on the flow template, on what it calls and on the "
                          "default constructor of the system");
            return RecordableFlow<System, n>;
        }
        return callable;
    }();

    StepperDoor(const System& system, const X& like) : Door<System, X>(system, like)
    {
        if constexpr (takes_series) {
            read_all(system, std::make_index_sequence<tape_count<System, n>()>{});
        }
    }

    /// @throws std::invalid_argument if there is no such order
    void prepare(const Taylor& method)
    {
        const int order = method.order;
        if (order != 0 && order != 12 && order != 16 && order != 20) throw_bad_taylor_order(order);
        given_order = order;
    }

    void compute(Mode mode, double t, const double* x, int order, double* out, double* guards)
    {
        if constexpr (takes_series) {
            dispatch(mode, t, x, order, out, guards,
                     std::make_index_sequence<tape_count<System, n>()>{});
        }
    }

    int given_order = 0;
    TaylorStep<n, m> step;

private:
    static constexpr std::size_t most_constants = [] {
        if constexpr (!takes_series) {
            return std::size_t{0};
        } else {
            return []<std::size_t... mode>(std::index_sequence<mode...>)
            {
                return std::max({std::size_t{0},
                                 taylor_tape<System, n, static_cast<Mode>(mode)>.ops.size()...});
            }
            (std::make_index_sequence<tape_count<System, n>()>{});
        }
    }();

    template <std::size_t... mode>
    void read_all(const System& system, std::index_sequence<mode...>)
    {
        (read<mode>(system), ...);
    }
    template <std::size_t mode>
    void read(const System& system)
    {
        const auto match =
            read_constants<System, n, static_cast<Mode>(mode)>(system, constants_[mode]);
        if (match == TapeMatch::differs) throw_structure_differs(name_of_system(system));
        if (match == TapeMatch::not_finite) throw_constant_not_finite(name_of_system(system));
    }

    template <std::size_t... mode>
    void dispatch(Mode at, double t, const double* x, int order, double* out, double* guards,
                  std::index_sequence<mode...>)
    {
        constexpr bool one = sizeof...(mode) == 1;
        static_cast<void>((... || ((one || at == static_cast<Mode>(mode)) &&
                                   compute_in<static_cast<Mode>(mode)>(t, x, order, out, guards))));
    }
    template <Mode mode>
    bool compute_in(double t, const double* x, int order, double* out, double* guards)
    {
        using Series = TaylorSeries<taylor_tape<System, n, mode>, most_taylor_order>;
        Series::compute(constants_[static_cast<std::size_t>(mode)].data(), t, x, order, out,
                        guards);
        return true;
    }

    std::array<std::array<double, most_constants>, tape_count<System, n>()> constants_{};
};

template <class System, class X>
class KernelOf<System, X, Taylor> {
    using C = CoreState<X>;
    using State = StepState<C>;
    static constexpr std::size_t n = fixed_size<X>();
    static constexpr std::size_t m = series_guards<System, n>();
    using Array = std::array<double, n>;
    using D = StepperDoor<System, X, Taylor>;

    [[nodiscard]] static D& at(void* door) noexcept
    {
        return *static_cast<D*>(static_cast<Door<System, X>*>(door));
    }

    /// The coefficients of the step from the start in hand, if they are not those already.
    [[gnu::always_inline]] static TaylorStep<n, m>& expand(void* door, const State& state,
                                                           int order)
    {
        D& of = at(door);
        TaylorStep<n, m>& step = of.step;
        bool same = step.order >= order && step.mode == state.mode &&
                    step.backward == state.backward && step.start.value == state.start.value &&
                    step.start.remainder == state.start.remainder;
        for (std::size_t i = 0; i < n; ++i) same = same && step.x[i] == state.x0[i];
        if (!same) expand_anew(of, state, order);
        return step;
    }

    [[gnu::noinline]] static void expand_anew(D& of, const State& state, int order)
    {
        TaylorStep<n, m>& step = of.step;
        step.order = 0;  // until all is known, whatever the flow throws
        for (std::size_t i = 0; i < n; ++i) step.x[i] = state.x0[i];
        double* const c = step.coefficients.data();
        double* const g = step.guards.data();
        of.compute(state.mode, state.start.value, step.x.data(), order, c, g);
        if (state.backward) {
            for (std::size_t k = 1; k <= static_cast<std::size_t>(order); k += 2) {
                for (std::size_t i = 0; i < n; ++i) c[k * n + i] = -c[k * n + i];
                for (std::size_t i = 0; i < m; ++i) g[k * m + i] = -g[k * m + i];
            }
        }
        step.start = state.start;
        step.mode = state.mode;
        step.backward = state.backward;
        step.order = order;
        step.reach = std::numeric_limits<double>::quiet_NaN();
    }

    /// The largest h at which the last two terms stay within atol + rtol |x|.
    [[nodiscard, gnu::always_inline]] static double find_reach(const State& state, const double* c,
                                                               int order, double rtol, double atol)
    {
        const double* const each = state.component_atol;
        const auto longest = [&](const Array& size) {
            double last = 0, before = 0;
            const double* const cp = c + static_cast<std::size_t>(order) * n;
            for (std::size_t i = 0; i < n; ++i) {
                const double scale = 1 / ((each ? each[i] : atol) + rtol * size[i]);
                last = std::max(last, std::fabs(cp[i]) * scale);
                before = std::max(before, std::fabs(cp[i - n]) * scale);
            }
            // Nothing in the last two terms: a polynomial, as far as can be seen.
            const double least = std::numeric_limits<double>::min();
            if (!(last > least) && !(before > least)) return infinity;
            const double most = std::numeric_limits<double>::max();
            const double by_last = rough_log2(std::clamp(last, least, most)) / order;
            const double by_before = rough_log2(std::clamp(before, least, most)) / (order - 1);
            return rough_exp2(-std::max(by_last, by_before));
        };
        Array size;
        for (std::size_t i = 0; i < n; ++i) size[i] = std::fabs(state.x0[i]);
        double h = longest(size);
        // What begins near zero and moves away has the size of its end, as with other methods.
        // A length grows with a twelfth power of the size at most: less is not worth another root.
        for (int again = 0; again < 3; ++again) {
            bool larger = false;
            for (std::size_t i = 0; i < n; ++i) {
                const double end = std::fabs(state.x0[i] + std::min(h, 1e100) * c[n + i]);
                larger = larger || end > 16 * size[i];
                size[i] = std::max(size[i], end);
            }
            if (!larger || !(h < infinity)) break;
            h = longest(size);
        }
        return h;
    }

    static double reach(void* door, State& state, double rtol, double atol)
    {
        const int order = taylor_order(at(door).given_order, rtol);
        TaylorStep<n, m>& step = expand(door, state, order);
        const double* const c = step.coefficients.data();
        ++state.flow_calls;
        for (std::size_t i = 0; i < n; ++i) state.rate0[i] = c[n + i];
        step.reach = find_reach(state, c, step.order, rtol, atol);
        return step.reach;
    }

    /// False where the end is not finite.
    [[gnu::always_inline]] static bool go(const TaylorStep<n, m>& step, State& state, double h)
    {
        const double* const c = step.coefficients.data();
        state.h = h;
        state.has_middle = false;
        state.asked_alone = 0;
        Array w, rate;
        evaluate_departure<true>(c, step.order, h, w, rate);
        double sum = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const double rate0 = c[n + i];
            const TwoSum end = two_sum(step.x[i], h * rate0 + (w[i] + state.remainder[i]));
            state.rate0[i] = rate0;
            state.w[i] = w[i];
            state.w_rate1[i] = rate[i];
            state.x1[i] = end.value;
            state.rate1[i] = rate0 + rate[i];
            if constexpr (!is_small<C>) state.large.remainder1[i] = end.remainder;
            sum += 0 * (state.x1[i] + state.rate1[i]);
        }
        return sum == 0;
    }

    static double attempt(void* door, State& state, double h, double rtol, double atol)
    {
        const int order = taylor_order(at(door).given_order, rtol);
        const TaylorStep<n, m>& step = expand(door, state, order);
        double longest = step.reach;
        if (!(longest >= 0)) longest = reach(door, state, rtol, atol);
        if (!go(step, state, h)) return std::numeric_limits<double>::quiet_NaN();
        // The last millionths are those by which a step is stretched to the end of a run.
        return h <= longest * (1 + 2e-6) ? 0 : std::pow(h / longest, order);
    }

    static bool take(void* door, State& state, double h)
    {
        const int order = at(door).step.order;  // that of the run, where it has begun
        const int given = at(door).given_order;
        return go(expand(door, state, given ? given : order ? order : most_taylor_order), state, h);
    }

    static void depart(void* door, State& state, double s, C& w, C& rate)
    {
        const TaylorStep<n, m>& step = expand(door, state, at(door).step.order);
        Array w_own, rate_own;
        evaluate_departure<true>(step.coefficients.data(), step.order, s, w_own, rate_own);
        for (std::size_t i = 0; i < n; ++i) {
            w[i] = w_own[i];
            rate[i] = rate_own[i];
        }
    }

    static void departure(void* door, const State& state, double s, C& w)
    {
        const TaylorStep<n, m>& step = expand(door, state, at(door).step.order);
        Array w_own, none;
        evaluate_departure<false>(step.coefficients.data(), step.order, s, w_own, none);
        for (std::size_t i = 0; i < n; ++i) w[i] = w_own[i];
    }

    static SeriesTerms series(void* door, const State& state)
    {
        const TaylorStep<n, m>& step = expand(door, state, at(door).step.order);
        return {step.coefficients.data(), step.order, n};
    }

    static SeriesTerms guard_series(void* door, const State& state)
    {
        const TaylorStep<n, m>& step = expand(door, state, at(door).step.order);
        return {step.guards.data(), step.order, m};
    }

    static constexpr double infinity = std::numeric_limits<double>::infinity();

public:
    [[nodiscard]] static constexpr StepKernel<C> make()
    {
        StepKernel<C> kernel;
        kernel.order = most_taylor_order;
        kernel.error_order = most_taylor_order - 1;
        kernel.end_rate = true;
        kernel.take = &take;
        kernel.attempt = &attempt;
        kernel.reach = &reach;
        kernel.depart = &depart;
        kernel.departure = &departure;
        kernel.series = &series;
        if constexpr (m > 0) kernel.guard_series = &guard_series;
        return kernel;
    }
};

}  // namespace detail

}  // namespace ricochet
