// An implicit method for stiff motion, without iterations.
//
//     #include "ricochet/rosenbrock.hpp"
//     integrate(system, x0, {.t_end = 100, .rtol = 1e-6}, ErrorControlled<Rosenbrock4>{});
//
// A step solves six linear systems with one matrix, I / (gamma h) - J. The Jacobian J is the first
// available of these three: the one that the system writes, row by row,
//
//     void jacobian([Mode,] double t, const X& x, std::span<double> rows) const
//
// the one from dual numbers, if the flow takes any scalar (guard.hpp), or forward
// differences, whose error of 1e-8 reduces the order of the method at tolerances below that. The
// matrix is dense: the method is for states of up to a few dozen components.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/dual_derivatives.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/dual.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

/// The method RODAS, of order 4 with an error estimate of order 3 and an interpolant of order 3;
/// L-stable and stiffly accurate (E. Hairer and G. Wanner, Solving Ordinary Differential Equations
/// II, 2nd edition, section IV.7). Steps are those of odeint's rosenbrock4 where the flow does not
/// depend on time; otherwise odeint's method has order 1, because one coefficient (d4) has the
/// wrong sign.
///
/// The polynomial of a step is its cubic interpolant; state-changing or terminal events are located
/// by separate steps. Rates at the ends of a step are those of the interpolant, because in stiff
/// motion the flow at a computed state is dominated by the error of that state times the fastest
/// rate.
///
/// Samples are of order 4 without a factorization of their own. A step with samples inside gets a
/// quartic (one evaluation of the flow and five substitutions): the cubic, bent until its slopes at
/// both ends and its curvature at the start, damped as in a stage, are those of the flow. A sample
/// is a point of it moved by one damped correction towards the flow (an evaluation and a
/// substitution), which takes the place of the order that an interpolant loses in stiff components.
/// Where the step is longer than a transient that no polynomial follows to the tolerance, each
/// sample is a step of its own.
struct Rosenbrock4 {
    template <class State>
    struct Stepper {
        static constexpr bool estimates_error = true;
        static constexpr bool fsal = true;
        static constexpr bool has_dense_output = true;
    };
};

namespace detail {

struct RodasTableau {
    static constexpr double gamma = 0.25;
    static constexpr std::array<double, 5> c = {0, 0.386, 0.21, 0.63, 1};
    static constexpr std::array<double, 4> d = {0.25, -0.1043, 0.1035, -0.3620000000000023e-01};
    using Row = std::array<double, 5>;
    static constexpr std::array<Row, 5> a = {
        {{},
         {0.1544000000000000e+01},
         {0.9466785280815826e+00, 0.2557011698983284e+00},
         {0.3314825187068521e+01, 0.2896124015972201e+01, 0.9986419139977817e+00},
         {0.1221224509226641e+01, 0.6019134481288629e+01, 0.1253708332932087e+02,
          -0.6878860361058950e+00}}};
    static constexpr std::array<Row, 6> m = {  // coefficients of the stages over h
        {{},
         {-0.5668800000000000e+01},
         {-0.2430093356833875e+01, -0.2063599157091915e+00},
         {-0.1073529058151375e+00, -0.9594562251023355e+01, -0.2047028614809616e+02},
         {0.7496443313967647e+01, -0.1024680431464352e+02, -0.3399990352819905e+02,
          0.1170890893206160e+02},
         {0.8083246795921522e+01, -0.7981132988064893e+01, -0.3152159432874371e+02,
          0.1631930543123136e+02, -0.6058818238834054e+01}}};
    /// The interpolant is x0 (1 - u) + u (x1 + (1 - u) (dense[0] + u dense[1])).
    static constexpr std::array<Row, 2> dense = {
        {{0.1012623508344586e+02, -0.7487995877610167e+01, -0.3480091861555747e+02,
          -0.7992771707568823e+01, 0.1025137723295662e+01},
         {-0.6762803392801253e+00, 0.6087714651680015e+01, 0.1643084320892478e+02,
          0.2476722511418386e+02, -0.6594389125716872e+01}}};
};

/// Whether the system writes its Jacobian.
template <class System, class X>
concept JacobianWritten = requires(const System& system, Mode mode, double t, const X& x,
                                   std::span<double> rows)
{
    system.jacobian(mode, t, x, rows);
}
|| requires(const System& system, double t, const X& x, std::span<double> rows)
{
    system.jacobian(t, x, rows);
};

/// Whether the system has a function `jacobian` with an unsuitable signature.
template <class System, class X>
concept JacobianMisfits = !JacobianWritten<System, X> && requires
{
    &System::jacobian;
};

/// `count` numbers; 0: sized at run time.
template <class T, std::size_t count>
using Numbers = std::conditional_t<(count > 0), std::array<T, count>, std::vector<T>>;

/// Factorizes A = L U in place, with row exchanges. False: A is singular or not finite.
[[nodiscard]] inline bool factorize(std::size_t n, double* a, std::size_t* rows) noexcept
{
    for (std::size_t i = 0; i < n; ++i) {
        std::size_t pivot = i;
        for (std::size_t k = i + 1; k < n; ++k) {
            if (std::fabs(a[k * n + i]) > std::fabs(a[pivot * n + i])) pivot = k;
        }
        rows[i] = pivot;
        if (pivot != i) std::swap_ranges(a + i * n, a + (i + 1) * n, a + pivot * n);
        const double inverse = 1 / a[i * n + i];
        if (!std::isfinite(inverse)) return false;
        for (std::size_t k = i + 1; k < n; ++k) {
            const double factor = a[k * n + i] *= inverse;
            if (factor == 0) continue;
            for (std::size_t j = i + 1; j < n; ++j) a[k * n + j] -= factor * a[i * n + j];
        }
    }
    return true;
}

/// Replaces b by A^-1 b.
template <class C>
void substitute(std::size_t n, const double* a, const std::size_t* rows, C& b) noexcept
{
    for (std::size_t i = 0; i < n; ++i) std::swap(b[i], b[rows[i]]);
    for (std::size_t i = 1; i < n; ++i) {
        for (std::size_t j = 0; j < i; ++j) b[i] -= a[i * n + j] * b[j];
    }
    for (std::size_t i = n; i-- > 0;) {
        for (std::size_t j = i + 1; j < n; ++j) b[i] -= a[i * n + j] * b[j];
        b[i] /= a[i * n + i];
    }
}

/// Whether the quartic of a step is known, and within the tolerance.
enum class Quartic { unknown, accurate, inaccurate };

/// Work space of Rosenbrock's method between calls, for n components; 0: as many as a vector has.
template <class C, std::size_t n>
struct RosenbrockRoom {
    explicit RosenbrockRoom(const C& like)
        : x(like),
          rate(like),
          by_time(like),
          alone(like),
          at(like),
          flow(like),
          increment(like),
          error(like),
          steady(like),
          start_gap(like),
          end_gap(like),
          bend(like)
    {
        stages.fill(like);
        if constexpr (n == 0) {
            const std::size_t size = like.size();
            jacobian.resize(size * size);
            factors.resize(size * size);
            rows.resize(size);
            series.resize(4 * size);
        }
    }

    // The start of the steps: values here serve steps of any length.
    Instant start;
    Mode mode = 0;
    bool backward = false;
    bool known = false;
    C x, rate, by_time;  ///< f and df/ds
    C alone;             ///< 1 for components whose rate has no derivative
    Numbers<double, n * n> jacobian{};

    // One step from that start.
    C at, flow, increment, error;
    /// 1 for components whose rate is the same, bit for bit, in all stages: they move by h times
    /// it, without the rounding of the coefficients.
    C steady;
    std::array<C, 5> stages;
    Numbers<double, n * n> factors{};
    Numbers<std::size_t, n> rows{};

    // The current step: its interpolant as a power series, and its length.
    Numbers<double, 4 * n> series{};
    double h = std::numeric_limits<double>::quiet_NaN();
    double factored = std::numeric_limits<double>::quiet_NaN();  ///< length that `factors` are of

    // Its quartic: what h times the slopes at both ends lack, and the factor of u^2 (1 - u)^2.
    Quartic quartic = Quartic::unknown;
    C start_gap, end_gap, bend;
};

template <class System, class X>
struct StepperAdapter<System, X, Rosenbrock4> : SystemAdapter<System, X> {
    static_assert(
        !JacobianMisfits<System, X>,
        "ricochet: found a jacobian whose parameters do not fit, or that is not const; "
        "expected void jacobian([Mode,] double t, const State& x, std::span<double> rows) "
        "const");

    StepperAdapter(const System& system, const X& like)
        : SystemAdapter<System, X>(system, like), room(core_state(like))
    {
    }
    using Room =
        RosenbrockRoom<CoreState<X>, fixed_size<CoreState<X>>() == 0 ? 0 : fixed_size<X>()>;
    Room room;
};

template <class System, class X>
class KernelOf<System, X, Rosenbrock4> {
    using C = CoreState<X>;
    using State = StepState<C>;
    using D = StepperAdapter<System, X, Rosenbrock4>;
    using Room = typename D::Room;
    using Table = RodasTableau;

    static constexpr bool by_duals = flow_takes_duals<System, X>;

    /// Calls `function(i)` for every component, without the zeros behind those of a small state.
    template <class Function>
    [[gnu::always_inline]] static void for_components(const C& x, const Function& function)
    {
        if constexpr (is_small<C>) {
            for_each_index<fixed_size<X>()>(function);
        } else {
            for_each_component(x, function);
        }
    }

    [[nodiscard]] static D& at(void* adapter) noexcept
    {
        return *static_cast<D*>(static_cast<SystemAdapter<System, X>*>(adapter));
    }

    /// Writes dx/ds at offset s and state x into `rate`.
    static void flow(D& adapter, State& state, double s, const C& x, C& rate)
    {
        ++state.flow_calls;
        state.flow_fits &= adapter.flow(state.mode, state.flow_time(s), x, rate);
        if (state.backward) {
            for_components(x, [&](auto i) { rate[i] = -rate[i]; });
        }
    }

    // --- the Jacobian ---

    static void jacobian_written(D& adapter, const State& state)
    {
        Room& room = adapter.room;
        const std::span<double> rows(room.jacobian.data(), room.jacobian.size());
        const X& x = adapter.read(state.x0, 0);
        const double t = state.flow_time(0);
        if constexpr (requires { adapter.system().jacobian(state.mode, t, x, rows); }) {
            adapter.system().jacobian(state.mode, t, x, rows);
        } else {
            adapter.system().jacobian(t, x, rows);
        }
    }

    /// Columns of the Jacobian, and after them the derivative by time, four at a time.
    static void jacobian_by_duals(D& adapter, State& state)
    {
        constexpr std::size_t width = 4;
        using S = Dual<width>;
        Room& room = adapter.room;
        const std::size_t n = state.x0.size();
        Scratch<WithScalar<X, S>, 2> states(state.x0);
        for (std::size_t first = 0; first <= n; first += width) {
            S time(state.flow_time(0));
            if (first <= n && n < first + width) time.slope[n - first] = 1;
            for (std::size_t i = 0; i < n; ++i) {
                S& x = states[0][i] = S(state.x0[i]);
                if (first <= i && i < first + width) x.slope[i - first] = 1;
            }
            ++state.flow_calls;
            flow_of_scalar(adapter.system(), state.mode, time, states[0], states[1]);
            for (std::size_t k = 0; k < width && first + k <= n; ++k) {
                for (std::size_t i = 0; i < n; ++i) {
                    double& to =
                        first + k == n ? room.by_time[i] : room.jacobian[i * n + first + k];
                    to = states[1][i].slope[k];
                }
            }
        }
    }

    static void jacobian_by_differences(D& adapter, State& state)
    {
        Room& room = adapter.room;
        const std::size_t n = state.x0.size();
        for (std::size_t j = 0; j < n; ++j) {
            room.at = state.x0;
            const double moved = state.x0[j] + std::copysign(reach_of(state.x0[j]), room.rate[j]);
            room.at[j] = moved;
            const double delta = moved - state.x0[j];
            flow(adapter, state, 0, room.at, room.flow);
            for (std::size_t i = 0; i < n; ++i) {
                room.jacobian[i * n + j] = (room.flow[i] - room.rate[i]) / delta;
            }
        }
    }

    /// df/ds by a difference forward from the start, inside the step of length h, where the flow
    /// exists.
    static void by_time_by_differences(D& adapter, State& state, double h)
    {
        Room& room = adapter.room;
        const double reach = std::min(reach_of(state.start.value), h);
        const double later = state.start.plus(state.in_time(reach));
        const double delta = state.in_time(later - state.start.value);
        flow(adapter, state, delta, state.x0, room.flow);
        for_components(state.x0,
                       [&](auto i) { room.by_time[i] = (room.flow[i] - room.rate[i]) / delta; });
    }

    /// Length of a difference at x, which changes x however large it is.
    [[nodiscard]] static double reach_of(double x) noexcept
    {
        constexpr double epsilon = std::numeric_limits<double>::epsilon();
        const double size = std::fabs(x);
        return std::max(std::sqrt(epsilon * std::max(1e-5, size)), 4 * epsilon * size);
    }

    /// Computes f, df/ds and J at the start of a step of length h, unless they are known for this
    /// very start.
    static void prepare(D& adapter, State& state, double h)
    {
        Room& room = adapter.room;
        bool same = room.known && room.start.value == state.start.value &&
                    room.start.remainder == state.start.remainder && room.mode == state.mode &&
                    room.backward == state.backward && room.x.size() == state.x0.size();
        if (same)
            for_components(state.x0, [&](auto i) { same = same && room.x[i] == state.x0[i]; });
        if (same) return;
        if (room.x.size() != state.x0.size()) room = Room(state.x0);
        room.known = false;  // stays so if the flow throws
        room.h = room.factored = std::numeric_limits<double>::quiet_NaN();
        flow(adapter, state, 0, state.x0, room.rate);
        const double sign = state.backward ? -1 : 1;
        const auto turn = [&] {
            for (double& each : room.jacobian) each *= sign;
        };
        if constexpr (JacobianWritten<System, X>) {
            jacobian_written(adapter, state);
            turn();
            by_time_by_differences(adapter, state, h);
        } else if constexpr (by_duals) {
            jacobian_by_duals(adapter, state);
            turn();  // but not df/ds, whose sign changes twice
        } else {
            jacobian_by_differences(adapter, state);
            by_time_by_differences(adapter, state, h);
        }
        for_components(state.x0, [&](auto i) {
            const double* const row =
                room.jacobian.data() + static_cast<std::size_t>(i) * state.x0.size();
            const bool alone =
                std::all_of(row, row + state.x0.size(), [](double slope) { return slope == 0; });
            room.alone[i] = alone && room.by_time[i] == 0 ? 1 : 0;
        });
        room.x = state.x0;
        room.start = state.start;
        room.mode = state.mode;
        room.backward = state.backward;
        room.known = true;
    }

    // --- steps ---

    /// Factorizes I / (gamma h) - J; false if that is singular.
    static bool factorize_for(Room& room, double h)
    {
        if (room.factored == h) return true;
        const std::size_t n = room.x.size();
        for (std::size_t i = 0; i < n * n; ++i) room.factors[i] = -room.jacobian[i];
        for (std::size_t i = 0; i < n; ++i) room.factors[i * n + i] += 1 / (Table::gamma * h);
        room.factored = std::numeric_limits<double>::quiet_NaN();
        if (!factorize(n, room.factors.data(), room.rows.data())) return false;
        room.factored = h;
        return true;
    }

    /// Computes increment and error of a step of length h; false if it cannot be solved.
    static bool solve(D& adapter, State& state, double h)
    {
        prepare(adapter, state, h);
        Room& room = adapter.room;
        const std::size_t n = state.x0.size();
        if (!factorize_for(room, h)) return false;
        assign(room.steady, room.alone);
        for (std::size_t k = 0; k < 5; ++k) {
            if (k > 0) {
                assign(room.at, state.x0);
                for (std::size_t j = 0; j < k; ++j) add(room.at, Table::a[k][j], room.stages[j]);
                flow(adapter, state, Table::c[k] * h, room.at, room.flow);
                note_changes(room, room.flow);
            }
            C& stage = room.stages[k];
            assign(stage, k > 0 ? room.flow : room.rate);
            if (k < 4) add(stage, h * Table::d[k], room.by_time);
            for (std::size_t j = 0; j < k; ++j) add(stage, Table::m[k][j] / h, room.stages[j]);
            substitute(n, room.factors.data(), room.rows.data(), stage);
        }
        add(room.at, 1, room.stages[4]);
        flow(adapter, state, h, room.at, room.error);
        note_changes(room, room.error);
        for (std::size_t j = 0; j < 5; ++j) add(room.error, Table::m[5][j] / h, room.stages[j]);
        substitute(n, room.factors.data(), room.rows.data(), room.error);
        for_components(state.x0, [&](auto i) {
            double sum = room.error[i] + room.stages[4][i];
            for (std::size_t j = 0; j < 4; ++j) sum += Table::a[4][j] * room.stages[j][i];
            const bool steady = room.steady[i] != 0;
            room.increment[i] = steady ? h * room.rate[i] : sum;
            if (steady) room.error[i] = 0;
        });
        return true;
    }

    /// A component whose rate is no longer that at the start is not steady.
    static void note_changes(Room& room, const C& rate)
    {
        for_components(rate, [&](auto i) {
            if (!(rate[i] == room.rate[i])) room.steady[i] = 0;
        });
    }

    /// Coefficient k = 1, 2, 3 of the interpolant in s, from the last step solved.
    struct Terms {
        double first, second, third;
    };
    template <class Index>
    [[nodiscard]] static Terms terms(const Room& room, Index i, double h) noexcept
    {
        if (room.steady[i] != 0) return {room.rate[i], 0, 0};
        double p = 0;
        double q = 0;
        for (std::size_t j = 0; j < 5; ++j) {
            p += Table::dense[0][j] * room.stages[j][i];
            q += Table::dense[1][j] * room.stages[j][i];
        }
        const double r = 1 / h;
        const double third = -q * r * r * r;
        // The curvature of a step that is so short is rounding, and it is straight.
        if (!std::isfinite(third)) return {room.increment[i] * r, 0, 0};
        return {(room.increment[i] + p) * r, (q - p) * r * r, third};
    }

    static void add(C& to, double factor, const C& what)
    {
        for_components(to, [&](auto i) { to[i] += factor * what[i]; });
    }

    /// Takes the current step; false if it is not finite.
    static bool go(void* adapter, State& state, double h)
    {
        D& of = at(adapter);
        state.h = h;
        state.has_middle = false;
        state.asked_alone = 0;
        if (!solve(of, state, h)) return false;
        Room& room = of.room;
        const std::size_t n = state.x0.size();
        double sum = 0;
        for_components(state.x0, [&](auto i) {
            const auto c = static_cast<std::size_t>(i);
            const Terms term = terms(room, i, h);
            room.series[n + c] = term.first;
            room.series[2 * n + c] = term.second;
            room.series[3 * n + c] = term.third;
            state.rate0[i] = term.first;
            state.w[i] = room.increment[i] - h * term.first;
            state.w_rate1[i] = h * (2 * term.second + h * (3 * term.third));
            const TwoSum end =
                two_sum(state.x0[i], h * term.first + (state.w[i] + state.remainder[i]));
            state.x1[i] = end.value;
            state.rate1[i] = term.first + state.w_rate1[i];
            if constexpr (!is_small<C>) state.large.remainder1[i] = end.remainder;
            sum += 0 * (state.x1[i] + state.rate1[i]);
        });
        room.h = h;
        room.quartic = Quartic::unknown;
        return sum == 0;
    }

    static bool take(void* adapter, State& state, double h) { return go(adapter, state, h); }

    static double attempt(void* adapter, State& state, double h, double rtol, double atol)
    {
        if (!go(adapter, state, h)) return std::numeric_limits<double>::quiet_NaN();
        return largest_ratio(state, at(adapter).room.error, rtol, atol);
    }

    /// The largest ratio of a component's error to its tolerance.
    [[nodiscard]] static double largest_ratio(const State& state, const C& error, double rtol,
                                              double atol)
    {
        const double* const each = state.component_atol;
        double worst = 0;
        double lost = 0;
        for_components(state.x0, [&](auto i) {
            const double size = std::max(std::fabs(state.x0[i]), std::fabs(state.x1[i]));
            const double allowed = (each ? each[i] : atol) + rtol * size;
            const double ratio = error[i] == 0 ? 0 : std::fabs(error[i]) / allowed;
            worst = std::max(worst, ratio);
            lost += 0 * ratio;
        });
        return worst + lost;
    }

    /// The step damps a transient that is faster than itself, and its error estimate with it, but
    /// the interpolant overshoots as far to the other side. The difference between the flow at the
    /// start and the slope of the interpolant, damped as in a stage, is the size of that transient.
    static double roughness(void* adapter, State& state, double rtol, double atol)
    {
        D& of = at(adapter);
        Room& room = of.room;
        if (!solve(of, state, state.h)) return 0;
        for_components(state.x0, [&](auto i) { room.at[i] = room.rate[i] - state.rate0[i]; });
        substitute(state.x0.size(), room.factors.data(), room.rows.data(), room.at);
        return largest_ratio(state, room.at, rtol, atol);
    }

    /// Replaces x by (I - gamma h J)^-1 x, for the factors of a step of length h.
    static void damp(Room& room, double h, C& x)
    {
        substitute(room.x.size(), room.factors.data(), room.rows.data(), x);
        for_components(x, [&](auto i) { x[i] *= 1 / (Table::gamma * h); });
    }

    /// Bends the cubic p of the current step to the quartic
    ///
    ///     p(u) + u (1 - u)^2 start_gap - u^2 (1 - u) end_gap + u^2 (1 - u)^2 bend
    ///
    /// by what p lacks of h f at both ends and of h^2 (J f + df/ds) at the start. These are of
    /// order h^4, and damping changes them by order h^5, the local error of the method. False where
    /// a second damping would change the first of them by more than the tolerance: the step is
    /// longer than a transient.
    static bool find_quartic(D& adapter, State& state, double rtol, double atol)
    {
        Room& room = adapter.room;
        const double h = state.h;
        const std::size_t n = state.x0.size();
        if (!factorize_for(room, h)) return false;
        flow(adapter, state, h, state.x1, room.flow);
        for_components(state.x0, [&](auto i) {
            const auto c = static_cast<std::size_t>(i);
            double curvature = room.by_time[i];
            for (std::size_t j = 0; j < n; ++j) {
                curvature += room.jacobian[c * n + j] * room.rate[j];
            }
            room.start_gap[i] = h * (room.rate[i] - state.rate0[i]);
            room.end_gap[i] = h * (room.flow[i] - state.rate1[i]);
            room.bend[i] = h * h * (curvature / 2 - room.series[2 * n + c]) +
                           (2 * room.start_gap[i] + room.end_gap[i]);
        });
        damp(room, h, room.start_gap);
        damp(room, h, room.end_gap);
        damp(room, h, room.bend);
        damp(room, h, room.bend);
        assign(room.at, room.start_gap);
        damp(room, h, room.at);
        constexpr double most = 4.0 / 27;  // of u (1 - u)^2
        for_components(state.x0,
                       [&](auto i) { room.at[i] = most * (room.start_gap[i] - room.at[i]); });
        return largest_ratio(state, room.at, rtol, atol) <= 1;
    }

    /// The quartic at u, moved by gamma h (I - gamma h J)^-1 (f(x) - x'). That changes a point of
    /// order h^5 by order h^5, and puts stiff components on the slow motion.
    static bool sample(void* adapter, State& state, double s, double rtol, double atol, C& w)
    {
        using enum Quartic;
        D& of = at(adapter);
        Room& room = of.room;
        const double h = state.h;
        if (room.h != h) return false;
        if (s == h) return assign(w, state.w), true;
        if (room.quartic == unknown) {
            room.quartic = find_quartic(of, state, rtol, atol) ? accurate : inaccurate;
        }
        if (room.quartic == inaccurate || !factorize_for(room, h)) return false;
        const double u = s / h;
        const double v = 1 - u;
        const std::size_t n = state.x0.size();
        C& slope = room.error;
        for_components(w, [&](auto i) {
            const auto c = static_cast<std::size_t>(i);
            const double second = room.series[2 * n + c];
            const double third = room.series[3 * n + c];
            const double start = room.start_gap[i];
            const double end = room.end_gap[i];
            w[i] =
                s * s * (second + s * third) + u * v * (v * start - u * end + u * v * room.bend[i]);
            slope[i] = state.rate0[i] + s * (2 * second + 3 * s * third) +
                       (v * (1 - 3 * u) * start - u * (2 - 3 * u) * end +
                        2 * u * v * (v - u) * room.bend[i]) /
                           h;
            room.at[i] = state.x0[i] + (s * state.rate0[i] + w[i]);
        });
        flow(of, state, s, room.at, room.flow);
        C& correction = room.at;
        for_components(
            w, [&](auto i) { correction[i] = Table::gamma * h * (room.flow[i] - slope[i]); });
        damp(room, h, correction);
        // A part of a correction remains as an error where h J is of the order of -10, or changes
        // within the step. Found by trial: with 30 in place of 10, samples of x' = -1e4 (x - cos t)
        // at 1e-8 are wrong by two tolerances, with 10 by a fifth of one.
        constexpr double most = 10;
        if (!(largest_ratio(state, correction, rtol, atol) <= most)) return false;
        add(w, 1, correction);
        return true;
    }

    /// The method's own step of another length from the same start.
    static void depart(void* adapter, State& state, double s, C& w, C& rate)
    {
        D& of = at(adapter);
        if (s == 0 || !solve(of, state, s)) {
            const double lost = s == 0 ? 0 : std::numeric_limits<double>::quiet_NaN();
            for_components(w, [&](auto i) { w[i] = rate[i] = lost; });
            return;
        }
        for_components(w, [&](auto i) {
            const Terms term = terms(of.room, i, s);
            w[i] = of.room.increment[i] - s * state.rate0[i];
            rate[i] = (term.first - state.rate0[i]) + s * (2 * term.second + s * (3 * term.third));
        });
    }

    static detail::SeriesTerms series(void* adapter, const State& state)
    {
        return {at(adapter).room.series.data(), 3, static_cast<std::size_t>(state.x0.size())};
    }

    static void renew(void* adapter) { at(adapter).room.known = false; }

public:
    [[nodiscard]] static constexpr StepKernel<C> make()
    {
        StepKernel<C> kernel;
        kernel.order = 4;
        kernel.error_order = 3;
        kernel.end_rate = true;
        kernel.take = &take;
        kernel.attempt = &attempt;
        kernel.depart = &depart;
        kernel.sample = &sample;
        kernel.series = &series;
        kernel.roughness = &roughness;
        kernel.renew = &renew;
        return kernel;
    }
};

}  // namespace detail

}  // namespace ricochet
