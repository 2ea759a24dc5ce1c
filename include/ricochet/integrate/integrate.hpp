// The loop: smooth steps, events, resets, until the end or a reason to stop.
//
//     step from (t, x)              odeint, as an increment
//     detector.confirm(step)        clear, with its evidence, or a stretch of the step
//     locator.locate(stretch)       the instant at which the guard leaves its side
//     reset                         x⁻ becomes x⁺, the guard is armed anew
//
// Steps are half-open, (t, t + h]. A system without a guard compiles to the step
// alone. Between the first step and the last nothing is allocated for states of
// fixed size, unless events are recorded.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include "ricochet/detect/extremum.hpp"
#include "ricochet/hybrid/system.hpp"
#include "ricochet/integrate/explicit_step.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/integrate/run.hpp"
#include "ricochet/integrate/step_control.hpp"
#include "ricochet/locate/newton.hpp"

namespace ricochet {

namespace detail {

/// @throws std::invalid_argument: the start has no components.
[[noreturn]] void throw_start_empty();
/// @throws std::invalid_argument: the start is not finite.
[[noreturn]] void throw_start_not_finite(std::size_t component, double value);
/// @throws std::invalid_argument: the start is behind a unilateral guard.
[[noreturn]] void throw_start_outside_mode(double t, double guard);
/// @throws std::invalid_argument: a unilateral guard without a reset.
[[noreturn]] void throw_no_reset();
/// @throws std::invalid_argument: the guard is not finite at the start.
[[noreturn]] void throw_start_guard_not_finite(double t, double guard);

/// Recognises accumulating events: three intervals in a row that shrink, and a
/// geometric remainder d q / (1 - q) that is no longer worth resolving. And events
/// that do not advance time at all.
class ShrinkingIntervals {
public:
    /// Takes note of an event at `t`; true after a hundred in a row that time cannot
    /// tell apart.
    [[nodiscard]] bool stalls(const Instant& t) noexcept
    {
        const double interval = (t.value - last_.value) + (t.remainder - last_.remainder);
        shrinking_ = seen_ >= 2 && interval < interval_ ? shrinking_ + 1 : 0;
        ratio_ = shrinking_ > 0 ? interval / interval_ : 1;
        last_ = t;
        interval_ = interval;
        ++seen_;
        stalled_ = interval < resolution() / 4 ? stalled_ + 1 : 0;
        return stalled_ > 100;
    }

    /// Whether what is left after the event just noted is below `tolerance` [s] or
    /// the resolution of its time.
    [[nodiscard]] bool accumulate(double tolerance) const noexcept
    {
        const double rest = interval_ * ratio_ / (1 - ratio_);
        return shrinking_ >= 3 && rest < std::max(tolerance, resolution());
    }

private:
    [[nodiscard]] double resolution() const noexcept
    {
        return 16 * std::numeric_limits<double>::epsilon() * std::fabs(last_.value);
    }

    Instant last_;
    double interval_ = 0;
    double ratio_ = 1;
    std::size_t seen_ = 0;
    std::size_t shrinking_ = 0;
    std::size_t stalled_ = 0;
};

/// One run in progress.
template <class System, class X, class Stepping, class Detector, class Locator>
class Integration {
    using Method = typename Stepping::method;
    using CurrentStep = ExplicitStep<Method, System, X>;

    static constexpr bool guarded = Guarded<System, X>;
    static constexpr bool predicts = requires(const Detector& detector, const CurrentStep& step,
                                              const GuardView<System, X>& guard)
    {
        detector.clears(guard, step);
    };
    static constexpr bool error_controlled = std::is_same_v<Stepping, ErrorControlled<Method>>;

    static_assert(!error_controlled || has_error_estimate<typename CurrentStep::Stepper>,
                  "ricochet: error control needs one of odeint's error steppers, such as Dopri5");

public:
    Integration(const System& system, const X& x0, const Options& options, const Detector& detector,
                const Locator& locator)
        : system_(system),
          options_(checked(options, x0)),
          detector_(detector),
          locator_(locator),
          step_(system, options.t_start, x0)
    {
        h_next_ = options_.step > 0 ? options_.step : options_.t_end - options_.t_start;
        if constexpr (error_controlled) {
            if (options_.step == 0) h_next_ = initial_step();
            h_next_ = std::min(h_next_, options_.h_max);
        }
        if constexpr (guarded) {
            refuse_bad_start();
        }
        if constexpr (predicts) {
            const double smallest = error_controlled ? options_.h_min : options_.step;
            const double largest = error_controlled ? options_.h_max : options_.step;
            detector_.check(system, x0, smallest, largest);
        }
    }

    [[nodiscard]] Run<X> take()
    {
        if constexpr (guarded) {
            if (!ended_) arm(0);
        }
        while (!ended_) {
            advance();
        }
        finish();
        return std::move(run_);
    }

private:
    static const Options& checked(const Options& options, const X& x0)
    {
        check_declarations<System, X>();
        validate(options, !error_controlled);
        if (x0.size() == 0) throw_start_empty();
        for_each_component(x0, [&](auto i) {
            if (!std::isfinite(x0[i])) throw_start_not_finite(static_cast<std::size_t>(i), x0[i]);
        });
        return options;
    }

    void refuse_bad_start()
    {
        const double g = system_.guard(options_.t_start, step_.x0());
        if (!std::isfinite(g)) throw_start_guard_not_finite(options_.t_start, g);
        if (is_unilateral(system_) && !Resetting<System, X>) throw_no_reset();
        if (is_unilateral(system_) && g < 0) throw_start_outside_mode(options_.t_start, g);
    }

    void end(Outcome outcome) noexcept
    {
        run_.outcome = outcome;
        ended_ = true;
    }

    /// One step, with whatever event it holds.
    void advance()
    {
        const double remaining = step_.start().until(options_.t_end);
        if (!(remaining > 0)) return end(Outcome::reached_end);
        if (run_.statistics.steps == options_.max_steps) return end(Outcome::step_limit);
        if (!take_step(remaining)) return;

        if constexpr (guarded) {
            if (handle_event()) return;
        }
        emit_samples(step_.h());
        if (is_last_) {
            step_.accept_at(options_.t_end);
        } else {
            step_.accept();
        }
        ++run_.statistics.steps;
    }

    /// Takes a step no longer than `remaining` [s]. False: the run has ended.
    [[nodiscard]] bool take_step(double remaining)
    {
        // A remainder of a millionth of a step is rounding, not a step.
        is_last_ = h_next_ * (1 + 1e-6) >= remaining;
        const double h = is_last_ ? remaining : h_next_;
        if constexpr (error_controlled) {
            return take_controlled_step(h);
        } else {
            step_.attempt(h);
            if (!step_.end_is_finite()) {
                end(Outcome::non_finite);
                return false;
            }
            return true;
        }
    }

    [[nodiscard]] bool take_controlled_step(double h)
    {
        constexpr int order = static_cast<int>(CurrentStep::Stepper::error_order_value) + 1;
        double largest = rule_.largest;
        for (;;) {
            const double error = step_.attempt(h, options_.rtol, options_.atol);
            if (rule_.accepts(error)) {
                h_next_ =
                    std::min(h * std::min(largest, rule_.factor(error, order)), options_.h_max);
                return true;
            }
            ++run_.statistics.rejected;
            const bool finite = std::isfinite(error);
            h *= finite ? rule_.factor(error, order) : 0.1;
            is_last_ = false;
            largest = 1;
            if (h < smallest_step()) {
                end(finite ? Outcome::step_underflow : Outcome::non_finite);
                return false;
            }
        }
    }

    [[nodiscard]] double smallest_step() const noexcept
    {
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(step_.start().value);
        return std::max(options_.h_min, std::max(4 * ulp, std::numeric_limits<double>::min()));
    }

    /// A first step at which an Euler step and the change of the flow over it stay
    /// well inside the tolerance (Hairer, Norsett and Wanner I, section II.4).
    [[nodiscard]] double initial_step()
    {
        constexpr int order = static_cast<int>(CurrentStep::Stepper::error_order_value) + 1;
        const X& x = step_.x0();
        const X& dxdt = step_.rate0();
        const auto scale = [&](auto i) { return options_.atol + options_.rtol * std::fabs(x[i]); };
        double size = 0;
        double speed = 0;
        for_each_component(x, [&](auto i) {
            size = std::max(size, std::fabs(x[i]) / scale(i));
            speed = std::max(speed, std::fabs(dxdt[i]) / scale(i));
        });
        const double span = options_.t_end - options_.t_start;
        const double euler = size > 1e-5 && speed > 1e-5 ? 0.01 * size / speed : 1e-6 * span;
        X moved = x;
        X rate = dxdt;
        move(moved, x, euler, dxdt);
        step_.flow(euler, moved, rate);
        double bend = 0;
        for_each_component(
            x, [&](auto i) { bend = std::max(bend, std::fabs(rate[i] - dxdt[i]) / scale(i)); });
        const double fastest = std::max(speed, bend / euler);
        const double h = fastest <= 1e-15 ? std::max(1e-6 * span, euler * 1e-3)
                                          : std::pow(0.01 / fastest, 1.0 / order);
        const double first = std::min(std::min(100 * euler, h), options_.h_max);
        return std::isfinite(first) && first > 0 ? first : 1e-6 * span;
    }

    // --- events ---

    [[nodiscard]] GuardView<System, X> guard() noexcept
    {
        return {system_, run_.statistics.guard_calls};
    }

    /// Looks for an event in the step; true if there was one (or the run ended) and
    /// the step has been dealt with.
    [[nodiscard]] bool handle_event()
    {
        const auto guard = this->guard();
        bool cleared = false;
        if constexpr (predicts) {
            ++run_.statistics.network_calls;
            cleared = detector_.clears(guard, step_);
            if (cleared && !Detector::checks_every_step) {
                ++run_.statistics.checks_put_off;
                run_.statistics.evidence.add(Evidence::assumed);
                watch_.start = {};
                return false;
            }
        }
        const Finding finding = detector_.confirm(guard, step_, watch_);
        if (std::isnan(watch_.end.value)) {
            end(Outcome::non_finite);
            return true;
        }
        if (!finding.hit) {
            if (predicts && !cleared) ++run_.statistics.false_alarms;
            run_.statistics.evidence.add(finding.evidence);
            pass_on();
            return false;
        }
        ++run_.statistics.steps;
        if (cleared || finding.late) ++run_.statistics.missed_events;
        if (finding.late) {
            ++run_.statistics.late_events;
            const double t = step_.time(0);
            fire({.t = t,
                  .before = step_.x0(),
                  .after = step_.x0(),
                  .bracket = {t, t},
                  .late = true},
                 0, std::fabs(finding.lo.value));
        } else {
            locate_and_fire(guard, finding);
        }
        return true;
    }

    /// The end of a clear step becomes the start of the next.
    void pass_on() noexcept
    {
        if (watch_.side == Side::plateau || has_left(watch_.side, watch_.end.value)) {
            watch_.side = side_of(watch_.end.value);
        }
        watch_.start = watch_.end;
        watch_.start.s = 0;
    }

    [[gnu::noinline]] void locate_and_fire(const GuardView<System, X>& guard,
                                           const Finding& finding)
    {
        StepProbe probe(guard, step_, finding.side);
        probe.agree_on(finding.hi);
        const Location where = locator_.locate(probe, finding.lo, finding.hi,
                                               event_tolerance(step_.time(finding.hi.s)));
        emit_samples(where.hi);
        const X& before = probe.state_beyond(where.hi);
        const double t = step_.time(where.hi);
        fire({.t = t,
              .before = before,
              .after = before,
              .bracket = {step_.time(where.lo), t},
              .slope = where.slope,
              .error = where.error},
             where.hi, std::fabs(system_.guard(t, before)));
    }

    [[nodiscard]] double event_tolerance(double t) const noexcept
    {
        return options_.event_tolerance + options_.event_rtol * std::fabs(t);
    }

    /// Applies the reset to `event.after` and goes on from there, at offset s. The
    /// guard counts as being on its surface up to `band`, the residue of location.
    void fire(Event<X> event, double s, double band)
    {
        if constexpr (Resetting<System, X>) {
            system_.reset(event.t, event.after);
        }
        ++run_.statistics.events;
        const bool finite = all_finite(event.after);
        if (finite) step_.restart(s, event.after);
        if (options_.record_events) {
            if (run_.events.empty()) run_.events.reserve(16);  // most runs grow no further
            run_.events.push_back(std::move(event));
        }
        if (!finite) return end(Outcome::non_finite);
        if (options_.stop_at_event) return end(Outcome::stopped_by_event);
        const double tolerance = event_tolerance(step_.time(0));
        if (intervals_.stalls(step_.start()) ||
            (Resetting<System, X> && intervals_.accumulate(tolerance))) {
            return end(Outcome::zeno);
        }
        arm(band);
    }

    /// Determines the side of the guard at the start of a flight: its sign, or
    /// within `band` of the surface the sign of its first nonzero derivative.
    void arm(double band)
    {
        const auto guard = this->guard();
        const double t = step_.time(0);
        const X& x = step_.x0();
        watch_.start = {.s = 0, .value = guard.value(t, x)};
        const double g = watch_.start.value;
        if (!std::isfinite(g)) return end(Outcome::non_finite);

        const bool on_surface = std::fabs(g) <= band;
        if (Detector::uses_rates || on_surface) {
            watch_.start.rate = guard.rate(t, x, step_.rate0(), h_next_);
        }
        // Without a reset the state is where the guard left it, exactly on the surface
        // or across it.
        const bool decided = !Resetting<System, X> && g != 0;
        watch_.side = on_surface && !decided ? heading(watch_.start.rate) : side_of(g);
        if (is_unilateral(system_) && watch_.side != Side::above) meet_constraint(on_surface);
    }

    /// The side that a guard on its surface is about to be on.
    [[nodiscard]] Side heading(double rate)
    {
        if (rate != 0) return side_of(rate);
        // The second derivative has the sign of the rate a little later.
        const double delta = 1e-6 * h_next_;
        const X& dxdt = step_.rate0();
        X x = step_.x0();
        X later = dxdt;
        move(x, step_.x0(), delta, dxdt);
        step_.flow(delta, x, later);
        return side_of(guard().rate(step_.time(delta), x, later, h_next_));
    }

    /// The motion is at a unilateral guard and not leaving it: it meets its event at
    /// once. What the reset does not turn back stays there for ever.
    void meet_constraint(bool on_surface)
    {
        if (!on_surface) return end(Outcome::outside_mode);
        if constexpr (Resetting<System, X>) {
            const X before = step_.x0();
            X x = before;
            const double t = step_.time(0);
            system_.reset(t, x);
            bool unchanged = true;
            for_each_component(x, [&](auto i) { unchanged = unchanged && x[i] == before[i]; });
            if (unchanged || ++cascade_ > most_cascades) return end(Outcome::zeno);
            fire({.t = t, .before = before, .after = before, .bracket = {t, t}}, 0, 0);
            cascade_ = 0;
        } else {
            end(Outcome::zeno);
        }
    }

    // --- output ---

    /// Samples of the current step before its offset s.
    void emit_samples(double s)
    {
        const auto& times = options_.sample_times;
        while (next_sample_ < times.size() && times[next_sample_] < step_.time(s)) {
            const double offset = std::min(step_.start().until(times[next_sample_]), s);
            X x = step_.x0();
            if (offset > 0) step_.sample(offset, x);
            run_.trajectory.t.push_back(times[next_sample_]);
            run_.trajectory.x.push_back(std::move(x));
            ++next_sample_;
        }
    }

    void finish()
    {
        run_.t = step_.start().value;
        run_.x = step_.x0();
        run_.statistics.flow_calls = step_.flow_calls();
        run_.statistics.resteps = step_.resteps();
        const auto& times = options_.sample_times;
        while (next_sample_ < times.size() && times[next_sample_] <= run_.t) {
            run_.trajectory.t.push_back(times[next_sample_]);
            run_.trajectory.x.push_back(run_.x);
            ++next_sample_;
        }
    }

    static constexpr int most_cascades = 100;

    const System& system_;
    const Options& options_;
    const Detector& detector_;
    const Locator& locator_;
    CurrentStep step_;
    static constexpr ErrorRule rule_{};
    double h_next_ = 0;
    bool is_last_ = false;
    bool ended_ = false;
    Watch watch_;
    ShrinkingIntervals intervals_;
    int cascade_ = 0;
    std::size_t next_sample_ = 0;
    Run<X> run_;
};

}  // namespace detail

/// Integrates `system` from x0 at `options.t_start` to `options.t_end`.
///
/// @param system   declares what it has (see hybrid/system.hpp); not copied, not
///                 changed
/// @param x0       start; its type is the state type of the run
/// @param options  only `t_end` is required
/// @param stepping `ErrorControlled<Method>` or `FixedStep<Method>`
/// @param detector `Extremum`, `Ends`, a `Network`, or one that is `Verified`
/// @param locator  `Newton`, `Bisection` or `Toms748`
/// @throws std::invalid_argument for options, start or guard that make no sense.
///         What happens along the way is returned as `Run::outcome`.
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] Run<X> integrate(const System& system, const X& x0, const Options& options,
                               const Stepping& /*stepping*/ = {}, const Detector& detector = {},
                               const Locator& locator = {})
{
    return detail::Integration<System, X, Stepping, Detector, Locator>(system, x0, options,
                                                                       detector, locator)
        .take();
}

}  // namespace ricochet
