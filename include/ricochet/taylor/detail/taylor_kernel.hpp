// Internal: the declarations of this header may change without notice.
//
// Steps of Taylor's method.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include "ricochet/detail/guard_view.hpp"
#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/series_guard.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/step_probe.hpp"
#include "ricochet/taylor/detail/series_root.hpp"
#include "ricochet/taylor/detail/taylor_adapter.hpp"
#include "ricochet/taylor/detail/taylor_step.hpp"

namespace ricochet::detail {

/// The kernel of Taylor's method for states X of n components, whether their type fixes n or not.
template <class System, class X, std::size_t n>
class TaylorKernel {
    using C = CoreState<X>;
    using State = StepState<C>;
    using D = TaylorAdapter<System, X, n>;
    using TStep = typename D::Step;
    using Room = typename D::Room;
    using Array = typename Room::Array;
    using Y = typename Room::Guarded;

    /// Scratch of the size of the state, in registers where the compiler knows that size.
    struct OwnRoom {
        Room room;
        explicit OwnRoom(D& /*of*/) noexcept {}
    };
    struct BorrowedRoom {
        Room& room;
        explicit BorrowedRoom(D& of) noexcept : room(of.room) {}
    };
    using RoomFor = std::conditional_t<(n > 0), OwnRoom, BorrowedRoom>;

    [[nodiscard]] static D& at(void* adapter) noexcept
    {
        return *static_cast<D*>(static_cast<SystemAdapter<System, X>*>(adapter));
    }

    /// The coefficients of the step from the current start, unless they are known already.
    [[gnu::always_inline]] static TStep& expand(void* adapter, const State& state, int order)
    {
        D& of = at(adapter);
        TStep& step = of.step;
        const std::size_t size = step.size();
        bool same = size == state.x0.size() && step.asked >= order && step.order > 0 &&
                    step.mode == state.mode && step.backward == state.backward &&
                    step.start.value == state.start.value &&
                    step.start.remainder == state.start.remainder;
        for (std::size_t i = 0; i < size; ++i) same = same && step.x[i] == state.x0[i];
        if (!same) expand_anew(of, state, order);
        return step;
    }

    [[gnu::noinline]] static void expand_anew(D& of, const State& state, int order)
    {
        TStep& step = of.step;
        step.order = 0;  // until all is known, even if the flow throws
        if constexpr (n == 0) {
            if (step.size() != state.x0.size()) of.resize(state.x0.size());
        }
        const std::size_t size = step.size(), guards = step.guard_count();
        for (std::size_t i = 0; i < size; ++i) step.x[i] = state.x0[i];
        double* const c = step.coefficients.data();
        double* const g = step.guards.data();
        const int computed =
            of.compute(state.mode, state.start.value, step.x.data(), {order, c, g});
        if (state.backward) {
            for (std::size_t k = 1; k <= static_cast<std::size_t>(computed); k += 2) {
                for (std::size_t i = 0; i < size; ++i) c[k * size + i] = -c[k * size + i];
                for (std::size_t i = 0; i < guards; ++i) g[k * guards + i] = -g[k * guards + i];
            }
        }
        step.start = state.start;
        step.mode = state.mode;
        step.backward = state.backward;
        step.order = computed;
        step.asked = order;
        step.is_motion = of.is_polynomial(state.mode);
        step.reach = std::numeric_limits<double>::quiet_NaN();
    }

    [[nodiscard, gnu::always_inline]] static double length_of(D& of, const State& state,
                                                              double rtol, double atol)
    {
        TStep& step = of.step;
        step.doubtful = false;
        if (step.is_motion) return std::numeric_limits<double>::infinity();
        RoomFor scratch(of);
        Room& room = scratch.room;
        const auto reach = find_reach(state.x0, step.coefficients.data(), step.order,
                                      {rtol, atol, state.component_atol}, room.w);
        step.doubtful = !reach.agree;
        return reach.h;
    }

    static double reach(void* adapter, State& state, double /*h*/, double rtol, double atol)
    {
        const int order = taylor_order(at(adapter).given_order, rtol);
        TStep& step = expand(adapter, state, order);
        const double* const c = step.coefficients.data();
        const std::size_t size = step.size();
        ++state.flow_calls;
        for (std::size_t i = 0; i < size; ++i) state.rate0[i] = c[size + i];
        step.reach = length_of(at(adapter), state, rtol, atol);
        return step.reach;
    }

    /// Takes a step. False: its end is not finite.
    [[gnu::always_inline]] static bool go(D& of, State& state, double h)
    {
        const TStep& step = of.step;
        const std::size_t size = step.size();
        const double* const c = step.coefficients.data();
        state.h = h;
        state.has_middle = false;
        state.asked_alone = 0;
        RoomFor scratch(of);
        Room& room = scratch.room;
        Array& w = room.w;
        Array& rate = room.rate;
        evaluate_departure<true>(c, step.order, h, w, rate);
        double sum = 0;
        for (std::size_t i = 0; i < size; ++i) {
            const double rate0 = c[size + i];
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

    static double attempt(void* adapter, State& state, double h, double rtol, double atol)
    {
        const int order = taylor_order(at(adapter).given_order, rtol);
        const TStep& step = expand(adapter, state, order);
        double longest = step.reach;
        if (!(longest >= 0)) longest = reach(adapter, state, h, rtol, atol);
        if (!go(at(adapter), state, h)) return std::numeric_limits<double>::quiet_NaN();
        // A step may be longer by millionths, to reach the end of a run.
        const double excess = h <= longest * (1 + 2e-6) ? 0 : std::pow(h / longest, step.order);
        return step.doubtful ? excess + defect(at(adapter), state, rtol, atol) : excess;
    }

    /// The largest difference between the flow at the end of the step and the rate of the series,
    /// times h and in `most_defect` tolerances; NaN where the flow is not finite.
    [[gnu::noinline]] static double defect(D& of, State& state, double rtol, double atol)
    {
        RoomFor scratch(of);
        Array& x = scratch.room.w;
        Array& rate = scratch.room.rate;
        const std::size_t size = of.step.size();
        for (std::size_t i = 0; i < size; ++i) x[i] = state.x1[i];
        ++state.flow_calls;
        static_cast<void>(call_flow(of.system(), state.mode, state.time(state.h), x, rate));
        double worst = 0, lost = 0;
        for (std::size_t i = 0; i < size; ++i) {
            const double there = state.backward ? -rate[i] : rate[i];
            const double each = state.component_atol ? state.component_atol[i] : atol;
            const double largest = std::max(std::fabs(state.x0[i]), std::fabs(x[i]));
            const double rounding = 64 * std::numeric_limits<double>::epsilon() *
                                    (std::fabs(there) + std::fabs(state.rate0[i]));
            const double allowed = most_defect * (each + rtol * largest) + state.h * rounding;
            const double ratio = state.h * std::fabs(there - state.rate1[i]) / allowed;
            worst = std::max(worst, ratio);
            lost += 0 * ratio;
        }
        return worst + lost;
    }
    /// The last term that is kept contributes its order times the tolerance to the rate, and those
    /// that are omitted contribute less.
    static constexpr double most_defect = 100;

    static bool take(void* adapter, State& state, double h)
    {
        const int order = at(adapter).step.asked;  // the order of the run, where it has started
        const int given = at(adapter).given_order;
        expand(adapter, state, given ? given : order ? order : most_taylor_order);
        return go(at(adapter), state, h);
    }

    static void depart(void* adapter, State& state, double s, C& w, C& rate)
    {
        const TStep& step = expand(adapter, state, at(adapter).step.asked);
        RoomFor scratch(at(adapter));
        Room& room = scratch.room;
        evaluate_departure<true>(step.coefficients.data(), step.order, s, room.w, room.rate);
        const std::size_t size = step.size();
        for (std::size_t i = 0; i < size; ++i) {
            w[i] = room.w[i];
            rate[i] = room.rate[i];
        }
    }

    static void departure(void* adapter, const State& state, double s, C& w)
    {
        const TStep& step = expand(adapter, state, at(adapter).step.asked);
        RoomFor scratch(at(adapter));
        Room& room = scratch.room;
        evaluate_departure<false>(step.coefficients.data(), step.order, s, room.w, room.rate);
        const std::size_t size = step.size();
        for (std::size_t i = 0; i < size; ++i) w[i] = room.w[i];
    }

    static SeriesTerms series(void* adapter, const State& state)
    {
        const TStep& step = expand(adapter, state, at(adapter).step.asked);
        return {step.coefficients.data(), step.order, step.size()};
    }

    static SeriesTerms guard_series(void* adapter, const State& state)
    {
        const TStep& step = expand(adapter, state, at(adapter).step.asked);
        return {step.guards.data(), step.order, step.guard_count()};
    }

    // --- crossings ---

    using Guard = GuardView<System, Y>;

    /// As `StepKernel::cross`.
    static bool cross(void* adapter, State& state, SeriesCrossing& crossing)
    {
        const TStep& step = expand(adapter, state, at(adapter).step.asked);
        const double sign = crossing.side == Side::above ? 1 : -1;
        SeriesRoot root;
        const GuardSeries on_series{.terms = {step.guards.data(), step.order, step.guard_count()},
                                    .which = crossing.which,
                                    .h = state.h,
                                    .sign = sign,
                                    .from_surface = crossing.from_surface};
        if (!find_first_root(on_series, sign * crossing.end, root)) return false;
        const Guard guard(at(adapter).system(), crossing.calls,
                          {crossing.which, state.mode, state.backward});
        const double* const c = step.coefficients.data();
        const std::size_t size = step.size();
        RoomFor scratch(at(adapter));
        Room& room = scratch.room;
        Array& w = room.w;
        Array& rate = room.rate;
        Y& x = room.x;
        double correction = 0;
        for (int k = 0;; ++k) {
            evaluate_departure<true>(c, step.order, root.s, w, rate);
            for (std::size_t i = 0; i < size; ++i) {
                w[i] += state.remainder[i];
                x[own(i, x)] = step.x[i] + (root.s * c[size + i] + w[i]);
                rate[i] += c[size + i];
            }
            // The guard itself decides: its series omits its last terms.
            correction = -guard.value(state.time(root.s), x) / root.slope;
            if (std::fabs(correction) <= straight_part * root.s) break;
            root.s += correction;
            if (k == most_corrections || !(root.s > 0 && root.s < state.h)) return false;
        }
        const OnLine line{guard, state, x, rate, root, room.there};
        if (!close_in(line, correction, crossing)) return false;
        const double ahead = (crossing.root - root.s) + crossing.root_remainder;
        // A reset begins with this state: the rounding of its largest terms would be the largest
        // error of the impacts that follow.
        for (std::size_t i = 0; i < size; ++i) {
            const TwoSum moved = two_product(root.s, c[size + i]);
            const TwoSum sum = two_sum(step.x[i], moved.value);
            state.at[i] =
                sum.value + (sum.remainder + (moved.remainder + (w[i] + ahead * rate[i])));
        }
        return true;
    }
    /// Fraction of a root whose square is rounding: the motion is straight over it.
    static constexpr double straight_part = 0x1p-26;
    static constexpr int most_corrections = 3;

    /// The guard near a root, along the flow there.
    struct OnLine {
        const Guard& guard;
        const State& state;
        const Y& x;
        const Array& rate;
        const SeriesRoot& near;
        Y& there;  ///< scratch

        [[nodiscard]] double operator()(double s) const
        {
            for (std::size_t i = 0; i < rate.size(); ++i) {
                there[own(i, there)] = x[own(i, x)] + (s - near.s) * rate[i];
            }
            return guard.value(state.time(s), there);
        }
    };

    /// Brackets the root as closely as doubles lie, or as the rounding of the guard allows.
    static bool close_in(const OnLine& value, double correction, SeriesCrossing& crossing)
    {
        const TwoSum root = two_sum(value.near.s, correction);
        const double h = value.state.h;
        double margin = 0.75 * finest_bracket(root.value, h);
        double lo = root.value - margin, hi = root.value + margin;
        double beyond = value(hi);
        for (int k = 0; !has_left(crossing.side, beyond); ++k) {
            if (k == most_widenings) return false;
            lo = hi;
            hi += margin *= 2;
            beyond = value(hi);
        }
        for (int k = 0; lo < root.value && has_left(crossing.side, value(lo)); ++k) {
            if (k == most_widenings) return false;
            hi = lo;
            beyond = value(hi);
            lo -= margin *= 2;
        }
        if (!(lo > 0 && hi < h)) return false;
        const TwoSum at = root.value < lo ? TwoSum{lo, 0} : root.value > hi ? TwoSum{hi, 0} : root;
        crossing.lo = lo;
        crossing.hi = hi;
        crossing.root = at.value;
        crossing.root_remainder = at.remainder;
        crossing.slope = value.near.slope;
        crossing.error = std::max(std::fabs(beyond / value.near.slope), hi - lo);
        return true;
    }
    static constexpr int most_widenings = 8;

    // --- quiet runs ---

    [[nodiscard]] static double smallest_step(double h_min, double t) noexcept
    {
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(t);
        return std::max(h_min, std::max(4 * ulp, std::numeric_limits<double>::min()));
    }

    /// As `Step::accept`.
    [[gnu::always_inline]] static void accept(State& state)
    {
        state.start = state.start.after(state.in_time(state.h));
        if constexpr (is_small<C>) {
            constexpr std::size_t size = n;
            for (std::size_t i = 0; i < size; ++i) {
                const TwoSum sum = two_sum(
                    state.x0[i], state.h * state.rate0[i] + (state.w[i] + state.remainder[i]));
                state.x0[i] = sum.value;
                state.remainder[i] = sum.remainder;
                state.rate0[i] = state.rate1[i];
            }
        } else {
            std::swap(state.x0, state.x1);
            std::swap(state.remainder, state.large.remainder1);
            std::swap(state.rate0, state.rate1);
        }
    }

    /// Whether the guard has no event in the current step, at whose end its value is `run.g1`.
    [[gnu::always_inline]] static bool is_clear(const TStep& step, const State& state,
                                                const QuietRun& run)
    {
        if (!(run.sign * run.g1 > 0) || (!run.departs && run.sign * run.g0 < 0)) return false;
        const GuardSeries guard{.terms = {step.guards.data(), step.order, step.guard_count()},
                                .h = state.h,
                                .sign = run.sign,
                                .from_surface = run.departs || run.sign * run.g0 <= 0};
        if (!series_converges(guard.terms, 0, state.h, run.g0, run.g1)) return false;
        return series_clears(guard) || series_clears_closely(guard);
    }

    /// Whether the guard, if there is one, has no event in the current step, which then becomes the
    /// last step that it has passed.
    [[gnu::always_inline]] static bool passes(D& of, State& state, QuietRun& run)
    {
        if constexpr (on_series) {
            if (of.step.guard_count() == 0) return true;
            const Guard guard(of.system(), run.guard_calls,
                              {.mode = state.mode, .backward = state.backward});
            run.g1 = guard.value(state.time(state.h), loaded(of, state.x1));
            if (!is_clear(of.step, state, run)) return false;
            run.g0 = run.g1;
            run.rate0 = std::numeric_limits<double>::quiet_NaN();
            run.departs = false;
        }
        return true;
    }

    template <bool controlled>
    static void take_quiet_steps(void* adapter, State& state, QuietRun& run)
    {
        const int given = at(adapter).given_order;
        const int order = controlled                   ? taylor_order(given, run.rtol)
                          : given                      ? given
                          : at(adapter).step.asked > 0 ? at(adapter).step.asked
                                                       : most_taylor_order;
        run.why = QuietEnd::due;
        run.repeated = false;
        for (;;) {
            if (run.steps == run.most_steps) return;
            if (run.cancelled && run.cancelled->load(std::memory_order_relaxed)) return;
            TStep& step = expand(adapter, state, order);
            double h = run.h_next;
            if constexpr (controlled) {
                step.reach = length_of(at(adapter), state, run.rtol, run.atol);
                if (step.doubtful) return;  // the loop takes the step
                // The loop refuses a step that is still too long.
                if (!(step.reach >= smallest_step(run.h_min, state.start.value))) return;
                h = std::min(h, step.reach);
            }
            const double until = state.start.until(run.end);
            if (h * (1 + 1e-6) >= (state.backward ? -until : until)) return;
            if constexpr (controlled) ++state.flow_calls;
            if (!go(at(adapter), state, h)) {
                run.why = QuietEnd::failed;
                run.error = std::numeric_limits<double>::quiet_NaN();
                run.h_next = h;
                return;
            }
            const double next = controlled ? std::min(10 * h, run.h_max) : h;
            if (!passes(at(adapter), state, run)) {
                run.why = QuietEnd::doubt;
                run.h_next = next;
                return;
            }
            accept(state);
            ++run.steps;
            run.h_next = next;
        }
    }

    [[nodiscard, gnu::always_inline]] static decltype(auto) loaded([[maybe_unused]] D& of,
                                                                   const C& x)
    {
        if constexpr (std::is_same_v<Y, C>) {
            return (x);
        } else if constexpr (n > 0) {
            Y out;
            for (std::size_t i = 0; i < n; ++i) out[own(i, out)] = x[i];
            return out;
        } else {
            Y& out = of.room.x;
            for (std::size_t i = 0; i < x.size(); ++i) out[own(i, out)] = x[i];
            return (out);
        }
    }

    template <bool controlled>
    static void run_quietly(void* adapter, State& state, QuietRun& run)
    {
        const Instant start = state.start;
        const C x0 = state.x0, remainder = state.remainder, rate0 = state.rate0;
        try {
            take_quiet_steps<controlled>(adapter, state, run);
        } catch (...) {
            state.start = start;
            state.x0 = x0;
            state.remainder = remainder;
            state.rate0 = rate0;
            throw;
        }
    }

public:
    /// Whether guards have series.
    static constexpr bool on_series = D::on_series;

    template <bool controlled>
    [[nodiscard]] static constexpr QuietKernel<C> quiet() noexcept
    {
        return &run_quietly<controlled>;
    }

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
        if constexpr (on_series) {
            kernel.guard_series = &guard_series;
            kernel.cross = &cross;
        }
        return kernel;
    }
};

}  // namespace ricochet::detail
