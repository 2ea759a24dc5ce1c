// Internal: the declarations of this header may change without notice.
//
// Steps without an event, with the flow and the guard of a system inlined.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <type_traits>

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
    [[gnu::always_inline]] QuietSteps(void* door, StepState<C>& step, QuietRun& run)
        : door_(door), step_(step), run_(run), caller_(door, step), of_(step)
    {
    }

    [[gnu::always_inline]] void go()
    {
        run_.why = QuietEnd::due;
        run_.repeated = false;
        while (goes_on()) {
            double next = h_;
            if (!take(next)) {
                leave(h_);
                break;
            }
            if constexpr (guarded) {
                run_.why = screen();
                if (run_.why != QuietEnd::due) {
                    leave(next);
                    break;
                }
                g0_ = g1_;
                g_rate0_ = g_rate1_;
            }
            accept();
            h_ = next;
        }
        if (run_.why == QuietEnd::due) {
            run_.h_next = h_;
            put_start();
        }
        caller_.leave(step_);
        run_.g0 = g0_;
        run_.rate0 = g_rate0_;
        run_.g1 = g1_;
        run_.rate1 = g_rate1_;
        run_.inside = inside_;
    }

private:
    /// The state at the fraction `InsideOf::u` of the step, as `Step::peek` computes it.
    [[gnu::always_inline]] static X peeked(double h, const Values& of,
                                           [[maybe_unused]] const Stages& k)
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
            x0, [&](auto i) { still &= std::fabs(x1[i] - x0[i]) <= 0x1p-10 * std::fabs(x0[i]); });
        return still;
    }

    [[nodiscard]] static double smallest_step(double h_min, double t) noexcept
    {
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(t);
        return std::max(h_min, std::max(4 * ulp, std::numeric_limits<double>::min()));
    }

    [[nodiscard, gnu::always_inline]] static auto guard_of(void* door, QuietRun& run,
                                                           const FlowCaller<C>& caller)
    {
        if constexpr (std::is_same_v<System, ByPointer>) {
            static constexpr GuardInfo unused{};
            const SystemAt<C> system(*static_cast<const SystemTable<C>*>(run.system), door);
            return CoreGuard<C>(system, run.guard_calls, 0, caller.mode, unused, caller.backward);
        } else {
            return GuardView<System, X>(Of::at(door).system(), run.guard_calls, 0, caller.mode,
                                        Crossing::falling, caller.backward);
        }
    }

    [[nodiscard, gnu::always_inline]] bool goes_on() const
    {
        if (run_.steps == run_.most_steps) return false;
        const double until = caller_.start.until(run_.end);
        if (h_ * (1 + 1e-6) >= (caller_.backward ? -until : until)) return false;
        return !(run_.cancelled && run_.cancelled->load(std::memory_order_relaxed));
    }

    /// Takes a step, and repeats it with shorter ones until the error is in its tolerance;
    /// `next` is the length of the next. False where that fails.
    [[gnu::always_inline]] bool take(double& next)
    {
        double largest = rule.largest;
        run_.repeated = false;
        for (;;) {
            Of::template depart<controlled>(caller_, k_.data(), h_, of_);
            const bool finite = Of::end(caller_, h_, of_);
            if constexpr (!controlled) {
                if (!finite) run_.why = QuietEnd::failed;
                return finite;
            }
            run_.error = finite ? Of::worst_ratio(step_, of_, run_.rtol, run_.atol)
                                : std::numeric_limits<double>::quiet_NaN();
            if (rule.accepts(run_.error)) {
                const double factor = std::min(largest, rule.factor(run_.error, order));
                next = std::min(h_ * factor, run_.h_max);
                return true;
            }
            const double shorter = h_ * rule.factor(run_.error, order);
            if (!std::isfinite(run_.error) ||
                shorter < smallest_step(run_.h_min, caller_.start.value)) {
                run_.why = QuietEnd::failed;
                return false;
            }
            ++run_.rejected;
            h_ = shorter;
            largest = 1;
            run_.repeated = true;
        }
    }

    [[nodiscard, gnu::always_inline]] QuietEnd screen()
    {
        const auto guard = guard_of(door_, run_, caller_);
        const double t1 = caller_.time(h_);
        const X x1 = of_.x1, rate1 = of_.rate1;
        g1_ = guard.value(t1, x1);
        if constexpr (rates) g_rate1_ = guard.raw_rate(t1, x1, rate1, h_);
        QuietEnd why = QuietEnd::due;
        // The loop replaces a rate that is not finite.
        if (Screen::suspects(run_.sign, g0_, g_rate0_, g1_, g_rate1_, h_) ||
            !std::isfinite(g1_ + g_rate1_)) {
            why = QuietEnd::doubt;
        }
        if (rates && run_.checks_inside) {
            const X x = peeked(h_, of_, k_);
            inside_ = guard.value(caller_.time(CubicCheck::inside * h_), x);
            const CubicCheck look(g0_, g_rate0_, g1_, g_rate1_, h_);
            const double e = look.deviation(CubicCheck::inside, inside_);
            if (!(look.lowest(run_.sign) > CubicCheck::doubt * e)) why = QuietEnd::doubt;
            if (controlled && hardly_moves(of_.x0, x1)) why = QuietEnd::moving;
        }
        return why;
    }

    [[gnu::always_inline]] void accept()
    {
        caller_.start = caller_.start.after(caller_.backward ? -h_ : h_);
        for_each_component(
            of_.x0, [&](auto i) __attribute__((always_inline)) {
                const TwoSum sum =
                    two_sum(of_.x0[i], h_ * of_.rate0[i] + (of_.w[i] + of_.remainder[i]));
                of_.x0[i] = sum.value;
                of_.remainder[i] = sum.remainder;
                of_.rate0[i] = of_.rate1[i];
            });
        ++run_.steps;
    }

    [[gnu::always_inline]] void put_start()
    {
        step_.start = caller_.start;
        Of::put(of_.x0, step_.x0);
        Of::put(of_.rate0, step_.rate0);
        Of::put(of_.remainder, step_.remainder);
    }

    /// Leaves the current step where the loop expects it.
    [[gnu::always_inline]] void leave(double next)
    {
        put_start();
        step_.h = h_;
        step_.has_middle = false;
        step_.asked_alone = 0;
        Of::store(step_, k_, of_);
        run_.h_next = next;
    }

    static constexpr int order = Stepper::error_order_value + 1;
    void* door_;
    StepState<C>& step_;
    QuietRun& run_;
    FlowCaller<C> caller_;
    Values of_;
    Stages k_;
    double h_ = run_.h_next;
    double g0_ = run_.g0, g_rate0_ = run_.rate0, g1_ = 0, g_rate1_ = 0, inside_ = 0;
};

}  // namespace ricochet::detail
