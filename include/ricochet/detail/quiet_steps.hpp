// Internal: the declarations of this header may change without notice.
//
// Steps without an event, with the flow and the guard of a system inlined.
#pragma once

#include <atomic>
#include <cmath>
#include <limits>
#include <type_traits>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/cubic_check.hpp"
#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/step_of.hpp"

namespace ricochet::detail {

/// Steps without an event, in one loop whose variables are in registers.
/// @tparam Screen  `Ends` or `Extremum`; void without a guard
template <class System, class X, class Method, bool controlled, class Screen>
class QuietSteps {
    using Of = StepOf<System, X, Method>;
    using C = typename Of::C;
    using Stepper = typename Of::Stepper;
    using Stages = typename Of::Stages;
    using Values = typename Of::Values;
    static constexpr bool guarded = !std::is_void_v<Screen>;
    static constexpr bool rates = [] {
        if constexpr (guarded) return Screen::uses_rates;
        return false;
    }();
    static constexpr ErrorRule rule{};

public:
    /// Samples of the guard at both ends of a step, and inside.
    struct Samples {
        double sign, g0, rate0;
        double g1 = 0, rate1 = 0, inside = 0;
    };

    // References to variables of the caller: as members they would not all be in registers.
    void* adapter;
    StepState<C>& step;
    QuietRun& run;
    FlowCaller<C>& caller;
    Values& of;
    Stages& k;
    Samples& at;
    double& h;

    RICOCHET_BY_ONES static void go(void* adapter, StepState<C>& step, QuietRun& run)
    {
        FlowCaller<C> caller(adapter, step);
        Values of(step);
        Stages k;
        Samples at{.sign = run.sign, .g0 = run.g0, .rate0 = run.rate0};
        double h = run.h_next;
        QuietSteps steps{adapter, step, run, caller, of, k, at, h};
        run.why = QuietEnd::due;
        run.repeated = false;
        double next = h;
        while (steps.goes_on()) {
            next = h;
            if (!steps.take(next)) break;
            if constexpr (guarded) {
                const QuietEnd why = steps.screen();
                if (why != QuietEnd::due) {
                    run.why = why;
                    break;
                }
                at.g0 = at.g1;
                at.rate0 = at.rate1;
            }
            steps.accept();
            h = next;
        }
        steps.put_start();
        if (run.why == QuietEnd::due) {
            run.h_next = h;
        } else {
            steps.leave(run.why == QuietEnd::failed ? h : next);
        }
        caller.leave(step);
        run.g0 = at.g0;
        run.rate0 = at.rate0;
        run.g1 = at.g1;
        run.rate1 = at.rate1;
        run.inside = at.inside;
    }

private:
    /// The state at the fraction `InsideOf::u` of the step, as `Step::peek` computes it.
    [[nodiscard, gnu::always_inline]] X peeked() const
    {
        X x;
        const double s = InsideOf::u * h;
        if constexpr (Stepper::has_dense_output) {
            using Ours = RungeKutta<typename Stepper::Coefficients, X>;
            const auto weights = Ours::template weights<InsideOf>(h);
            for_each_component(
                x, [&](auto i) __attribute__((always_inline)) {
                    const double d = Ours::dense(weights, k.data(), of.w_rate, i);
                    x[i] = of.x0[i] + (s * of.rate0[i] + (d + of.remainder[i]));
                });
        } else {
            const double u = s / h;
            const double value = u * u * (3 - 2 * u);
            const double slope = h * u * u * (u - 1);
            for_each_component(
                x, [&](auto i) __attribute__((always_inline)) {
                    const double d = value * of.w[i] + slope * (of.rate1[i] - of.rate0[i]);
                    x[i] = of.x0[i] + (s * of.rate0[i] + (d + of.remainder[i]));
                });
        }
        return x;
    }

    [[nodiscard, gnu::always_inline]] static bool hardly_moves(const X& x0, const X& x1) noexcept
    {
        bool still = true;
        for_each_component(
            x0, [&](auto i) __attribute__((always_inline)) {
                still &= std::fabs(x1[i] - x0[i]) <= 0x1p-10 * std::fabs(x0[i]);
            });
        return still;
    }

    [[nodiscard]] static double smallest_step(double h_min, double t) noexcept
    {
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(t);
        return greatest_of(h_min, greatest_of(4 * ulp, std::numeric_limits<double>::min()));
    }

    [[nodiscard, gnu::always_inline]] auto guard_at_end() const
    {
        const GuardInMode of_run{.mode = caller.mode, .backward = caller.backward};
        if constexpr (std::is_same_v<System, ByPointer>) {
            static constexpr GuardInfo unused{};
            const SystemAt<C> system(*static_cast<const SystemTable<C>*>(run.system), adapter);
            return CoreGuard<C>(system, run.guard_calls, of_run, unused);
        } else {
            return GuardView<System, X>(Of::at(adapter).system(), run.guard_calls, of_run);
        }
    }

    [[nodiscard, gnu::always_inline]] bool goes_on() const
    {
        if (run.steps == run.most_steps) return false;
        const double until = caller.start.until(run.end);
        if (h * (1 + 1e-6) >= (caller.backward ? -until : until)) return false;
        return !(run.cancelled && run.cancelled->load(std::memory_order_relaxed));
    }

    /// Takes a step, and repeats it with shorter ones until the error is in its tolerance;
    /// `next` is the length of the next. False where that fails.
    [[gnu::always_inline]] bool take(double& next)
    {
        double largest = rule.largest;
        run.repeated = false;
        for (;;) {
            Of::depart(caller, k.data(), h, of, controlled);
            const bool finite = Of::end(caller, h, of);
            if constexpr (!controlled) {
                if (!finite) run.why = QuietEnd::failed;
                return finite;
            }
            run.error = finite ? Of::worst_ratio(step, of, run.rtol, run.atol)
                               : std::numeric_limits<double>::quiet_NaN();
            if (rule.accepts(run.error)) {
                const double factor = least_of(largest, rule.factor(run.error, order));
                next = least_of(h * factor, run.h_max);
                return true;
            }
            const double shorter = h * rule.factor(run.error, order);
            if (!std::isfinite(run.error) ||
                shorter < smallest_step(run.h_min, caller.start.value)) {
                run.why = QuietEnd::failed;
                return false;
            }
            ++run.rejected;
            h = shorter;
            largest = 1;
            run.repeated = true;
        }
    }

    /// A copy of a state or a rate, of the type that the guard takes.
    [[nodiscard, gnu::always_inline]] static auto seen(const X& x)
    {
        if constexpr (std::is_same_v<System, ByPointer>) {
            return Of::as_core(x);
        } else {
            return X(x);
        }
    }

    [[nodiscard, gnu::always_inline]] QuietEnd screen()
    {
        const auto guard = guard_at_end();
        const double t1 = caller.time(h);
        const auto x1 = seen(of.x1), rate1 = seen(of.rate1);
        at.g1 = guard.value(t1, x1);
        if constexpr (rates) at.rate1 = guard.raw_rate(t1, x1, rate1, h);
        QuietEnd why = QuietEnd::due;
        // The loop replaces a rate that is not finite.
        if (Screen::suspects(at.sign, {.value = at.g0, .rate = at.rate0},
                             {.s = h, .value = at.g1, .rate = at.rate1}) ||
            !std::isfinite(at.g1 + at.rate1)) {
            why = QuietEnd::doubt;
        }
        if (rates && run.checks_inside) {
            const auto x = seen(peeked());
            at.inside = guard.value(caller.time(CubicCheck::inside * h), x);
            const CubicCheck look(at.g0, at.rate0, at.g1, at.rate1, h);
            const double e = look.deviation(CubicCheck::inside, at.inside);
            if (!(look.lowest(at.sign) > CubicCheck::doubt * e)) why = QuietEnd::doubt;
            if (controlled && hardly_moves(of.x0, of.x1)) why = QuietEnd::moving;
        }
        return why;
    }

    [[gnu::always_inline]] void accept()
    {
        caller.start = caller.start.after(caller.backward ? -h : h);
        for_each_component(
            of.x0, [&](auto i) __attribute__((always_inline)) {
                const TwoSum sum = two_sum(of.x0[i], h * of.rate0[i] + (of.w[i] + of.remainder[i]));
                of.x0[i] = sum.value;
                of.remainder[i] = sum.remainder;
                of.rate0[i] = of.rate1[i];
            });
        ++run.steps;
    }

    [[gnu::always_inline]] void put_start()
    {
        step.start = caller.start;
        Of::put(of.x0, step.x0);
        Of::put(of.rate0, step.rate0);
        Of::put(of.remainder, step.remainder);
    }

    /// Leaves the current step where the loop expects it.
    [[gnu::always_inline]] void leave(double next)
    {
        step.h = h;
        step.has_middle = false;
        step.asked_alone = 0;
        Of::store(step, k, of);
        run.h_next = next;
    }

    static constexpr int order = Stepper::error_order_value + 1;
};

}  // namespace ricochet::detail
