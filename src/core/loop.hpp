// A run in progress: smooth steps, events, resets, until the end or a reason to stop.
//
//     step from (t, x)              the method, as a departure from the tangent
//     guards at its end             screened together
//     find                          the first set of events in the step
//     apply                         x⁻ becomes x⁺, the mode may change
//     settle                        arm every guard; guards that a reset carried across fire
//
// Steps are half-open, (t, t + h]. Between the first step and the last nothing is allocated for
// states of fixed size, unless something is recorded.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/engine.hpp"
#include "core/initial_step.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/lending_loop.hpp"
#include "ricochet/step_control.hpp"

namespace ricochet::detail {

/// Kernel of the quiet runs of a set-up; null: every step is one of the loop.
template <class X>
[[nodiscard]] QuietKernel<X> quiet_kernel(const RunBindings<X>& setup) noexcept;

template <class X, bool single>
class Loop : public LendingLoop<X> {
    using Engine = EventEngine<X, single>;

public:
    /// Keeps a reference to `setup`.
    Loop(const RunBindings<X>& setup, const X& x0, const Options& given)
        : setup_(setup),
          phases_(setup.system->phases),
          error_controlled_(setup.error_controlled),
          guarded_(setup.system->guarded),
          timed_(setup.system->timed()),
          defers_(defers(setup.detector, *setup.system)),
          backward_(given.t_end < given.t_start),
          engine_(setup, x0, checked(setup, given, x0),
                  {.who = "integrate", .repeats_steps = true}),
          components_(static_cast<std::size_t>(x0.size())),
          quiet_(quiet_kernel(setup))
    {
        if (std::isinf(given.t_end)) engine_.end_at(given.t_end);
        h_next() =
            options().step > 0 ? options().step : std::fabs(options().t_end - options().t_start);
        if (error_controlled_) {
            if (now().error_order() == 0) throw_no_error_estimate();
            now().measure_with(options().component_atol, options().atol);
            if (options().step == 0) h_next() = initial_step(now(), options(), h_next());
            h_next() = std::min(h_next(), options().h_max);
        }
        first_step_ = h_next();
        flight_start_ = options().t_start;
        engine_.refuse_bad_modes();
        if (!now().flow_fits()) throw_flow_does_not_fit("integrate", components_);
        if (guarded_) engine_.refuse_bad_guards();
        if (system()->forward_only && backward_) throw_forward_only();
        if (timed_) {
            if (backward_ && !system()->previous_time_event) throw_no_previous_time_event();
            engine_.find_time_event(Engine::After::start);
        }
        if (setup.detector.check) {
            const double smallest = error_controlled_ ? options().h_min : options().step;
            const double largest = error_controlled_ ? options().h_max : options().step;
            setup.detector.check(setup.detecting, setup.adapter, x0, smallest, largest);
        }
        if (guarded_) engine_.arm_at_start(!options().continues);
        if (engine_.is_endless() && !engine_.may_end()) throw_endless(given.t_end);
        if (guarded_ || timed_) engine_.settle_all();
        if (phases_) {
            if (phases_->list_in) phases_->list_in(system().adapter(), result().phases);
            review_phase(false);
        }
    }

    [[nodiscard]] double t() const noexcept override  ///< [s]
    {
        switch (showing_) {
            case Showing::sample: return result().trajectory.t[shown_samples_ - 1];
            case Showing::event: return result().events[shown_records_ - 1].t;
            case Showing::step: break;
        }
        return now().start().value;
    }
    [[nodiscard]] const X& x() const noexcept override
    {
        switch (showing_) {
            case Showing::sample: return result().trajectory.x[shown_samples_ - 1];
            case Showing::event: return result().events[shown_records_ - 1].after;
            case Showing::step: break;
        }
        return now().x0();
    }
    [[nodiscard]] Mode mode() const noexcept override
    {
        switch (showing_) {
            case Showing::sample: return sample_mode_;
            case Showing::event: return result().events[shown_records_ - 1].mode_after;
            case Showing::step: break;
        }
        return engine_.shown(now().mode());
    }
    [[nodiscard]] std::vector<double> reaction() const override;
    [[nodiscard]] bool ended() const noexcept override { return has_ended(); }
    /// Result so far; `finish` brings its time and state up to date.
    [[nodiscard]] const Run<X>& run() const noexcept override { return engine_.run(); }

    /// Cost and savings of the network of a `Metered` detector so far.
    [[nodiscard]] MeterReading meter() const override { return engine_.costs().reading(); }

    /// Takes one step, with any events that it holds. False: the run has ended. A detector
    /// that defers checks does not look ahead here, since every step is final.
    bool step() override
    {
        show_all();
        if (!has_ended()) advance_one({.look_ahead = false});
        return !has_ended();
    }

    /// Advances to the next sample time or event, which is shown once, with all others at its
    /// instant; `t`, `x` and `mode` are those there, after the events. Events whose states are not
    /// recorded are shown at the end of their step. False: the run has ended, and everything that
    /// has happened in it was shown.
    bool advance() override;

    /// Takes one step. If it looks ahead, the step may end in the middle of an interval of
    /// tentative steps.
    void advance_once(bool look_ahead) override { advance_one({.look_ahead = look_ahead}); }

    void run_to_end() override;

    /// Makes `advance` show only samples and events from here on.
    void show_all() noexcept override
    {
        shown_samples_ = result().trajectory.t.size();
        shown_records_ = result().events.size();
        shown_events_ = result().statistics.events;
        showing_ = Showing::step;
    }

    [[nodiscard]] std::size_t shown_events() const noexcept override { return shown_records_; }

    // --- quiet steps that are taken elsewhere ---

    bool go_to_quiet_steps(QuietRun& quiet, bool beyond) override;
    void take_back(const QuietRun& quiet) override { engine_.take_back(quiet); }
    [[nodiscard]] StepState<X>& lend() noexcept override { return now().lend(); }

    /// Advances to the end and returns the result.
    [[nodiscard]] Run<X> take() override
    {
        run_to_end();
        return finish();
    }

    /// Advances to the end; the result stays here.
    [[nodiscard]] const Run<X>& complete()
    {
        run_to_end();
        return bring_up_to_date();
    }

    /// Returns the result so far; before the end its outcome is `cancelled`. The simulation is
    /// over.
    [[nodiscard]] Run<X> finish() override;

    /// Brings the time, the state and the counts of `run` up to date, and its last samples where
    /// it has ended.
    const Run<X>& bring_up_to_date() override;

    /// Lets a run that was cancelled continue.
    void go_on() noexcept override
    {
        if (has_ended() && result().outcome == Outcome::cancelled) engine_.reopen();
    }

    /// State on which the future of the run depends. A simulation of the same system with the same
    /// options, stepping, detector and locator that restores it continues with the same
    /// bits; only its end, its sample times and what it records may differ. Recorded
    /// results are not part of it.
    [[nodiscard]] Snapshot save() override;

    /// @throws std::invalid_argument naming what does not agree if the snapshot is of another
    /// run, or does not hold a valid state; then nothing has changed.
    void restore(const Snapshot& snapshot) override;

    void restart(double t, const X& x, Mode mode) override;
    void extend(double t_end) override;

protected:
    /// Keeps the start of every step from here on, so that the run can continue after exceptions.
    void keep_resumable()
    {
        mark_ = std::make_unique<Mark>(engine_);
        now().store(mark_->at.start);
    }

private:
    static constexpr double infinity = std::numeric_limits<double>::infinity();

    /// The current step.
    [[nodiscard]] Step<X>& now() noexcept { return engine_.step(); }
    [[nodiscard]] const Step<X>& now() const noexcept { return engine_.step(); }
    /// The run so far.
    [[nodiscard]] Run<X>& result() noexcept { return engine_.run(); }
    [[nodiscard]] const Run<X>& result() const noexcept { return engine_.run(); }
    [[nodiscard]] const Options& options() const noexcept { return engine_.options(); }
    [[nodiscard]] const SystemAt<X>& system() const noexcept { return engine_.system(); }
    [[nodiscard]] Planner<X, single>& planner() noexcept { return engine_.planner(); }
    [[nodiscard]] const Planner<X, single>& planner() const noexcept { return engine_.planner(); }
    [[nodiscard]] double& h_next() noexcept { return engine_.h_next(); }
    [[nodiscard]] double h_next() const noexcept { return engine_.h_next(); }
    [[nodiscard]] double time_event() const noexcept { return engine_.time_event(); }
    [[nodiscard]] bool has_ended() const noexcept { return engine_.ended(); }
    /// The current step ends neither at a time event nor at the end of the run.
    void end_early() noexcept { is_last_ = engine_.ends_at().time_event = false; }

    // --- set-up ---

    /// The options, if they and the start are valid.
    [[nodiscard]] static const Options& checked(const RunBindings<X>& setup, const Options& options,
                                                const X& x0);

    [[nodiscard]] std::vector<RunProperty> properties() const;

    /// Checks that a run can reach the place read from a snapshot. @throws std::invalid_argument
    void refuse_bad_place() const;

    // --- steps ---

    /// The actions that a detector that defers checks may take.
    struct Advance {
        bool look_ahead = true;       ///< take steps that are closed only by a later check
        bool to_next_sample = false;  ///< but no step beyond one that holds a sample time
    };

    /// One step, with any events that it holds. If a function of the system throws and the run is
    /// kept resumable, everything is restored to the start of the step.
    void advance_one(const Advance& how)
    {
        if (mark_) return advance_resumably(how);
        const std::uint64_t steps = result().statistics.steps;
        advance_from_here(how);
        if (phases_) review_phase(result().statistics.steps != steps);
    }
    [[gnu::noinline]] void advance_resumably(const Advance& how);
    [[gnu::always_inline]] void advance_from_here(const Advance& how);

    /// What `advance` has stopped at.
    enum class Showing : std::uint8_t { step, sample, event };

    /// Start of the step whose events `advance` shows, of a run with phases.
    struct ShownStep {
        Mode mode = 0;
        double t = 0;
        X x{};
    };

    /// Shows the next sample or recorded event that lies in the steps taken, if there is one.
    [[nodiscard]] bool show_next();
    /// Whether events can be shown at their own times.
    [[nodiscard]] bool shows_events() const noexcept
    {
        return !setup_.add_event && engine_.records_states();
    }

    // --- interventions ---

    void refuse_bad_restart(double t, const X& x, Mode mode) const;
    void start_at(double t, const X& x, Mode mode);
    /// Drops what was recorded after t, except the events from number `recorded` on, those of a
    /// restart at t. `advance` is to show the last `count` events.
    void show_from_restart(double t, std::ptrdiff_t recorded, std::uint64_t count);
    /// Drops what was recorded after time t.
    void drop_from(double t);
    /// Places the step where `visit_state` has read the place.
    void go_on_from_place();

    // --- resumption after an exception ---

    struct Mark {
        explicit Mark(const Engine& engine) : at(engine) {}

        double h_next = 0;
        Statistics counts{};
        std::uint64_t disabled = 0;
        std::size_t events = 0, samples = 0, pieces = 0, next_sample = 0;
        std::size_t tentative = 0;  ///< number of steps that were not yet closed
        std::vector<double> phases{};
        bool planned = false;  ///< the guards are left alone until their deadlines
        bool newly_armed = false;
        bool everything = false;  ///< the members below are kept, too
        double flight_start = 0, longest_step = 0;
        typename Engine::Checkpoint at;
    };

    void mark_step() noexcept;
    void mark_phases();
    /// Keeps the state of the guards before events change it.
    void mark_everything()
    {
        if (mark_ && !mark_->everything) copy_to_mark();
    }
    [[gnu::noinline]] void copy_to_mark();
    void go_back_to_mark();
    void cut_records(const Mark& mark, std::size_t samples, std::size_t pieces);
    void rewind_counts(const Mark& mark, std::uint64_t steps, std::uint64_t rejected);

    /// Keeps the state before a step that ends at a time event, or that needs further evaluations
    /// to be recorded.
    void mark_what_lasts()
    {
        if (mark_ && (engine_.ends_at().time_event || options().record_steps || holds_sample())) {
            mark_everything();
        }
    }

    // --- quiet runs: consecutive steps without events ---

    [[nodiscard]] bool may_run_quietly() const noexcept
    {
        return quiet_ && engine_.holds().empty() && now().start().value != options().t_end &&
               result().statistics.steps < next_review_ && !options().record_steps &&
               next_sample_ >= options().sample_times.size() && engine_.guards().is_steady();
    }

    /// Takes steps until one needs a check, and handles it. False: no step did. After an exception
    /// the run returns to the start of the quiet run.
    [[gnu::always_inline]] bool run_quietly();
    [[gnu::noinline]] bool run_quietly_resumably();
    [[gnu::always_inline]] bool run_quietly_from_here();
    /// Limits and settings for the quiet steps from here on.
    [[nodiscard, gnu::always_inline]] QuietRun quiet_orders() const;
    [[gnu::always_inline]] void run_quietly(QuietRun& quiet);
    [[gnu::always_inline]] void end_quiet_run(const QuietRun& quiet);

    /// Whether the limits of the options allow further steps; also sets when to ask next.
    [[gnu::noinline]] bool may_take_more_steps();

    /// Where the run was at a review, and the number of steps at which the next one is due.
    struct Review {
        std::uint64_t due = 0, steps = 0, events = 0, instants = 0;
        double t = 0;
    };
    void renew(Review& review, std::uint64_t stride, bool is_first) noexcept;

    /// Number of steps after which the pace of a run with a limit on its steps is reviewed.
    [[nodiscard]] std::uint64_t pace_steps() const noexcept
    {
        constexpr std::uint64_t most = 20'000;  // under two seconds where a step takes 80 us
        const bool limited = options().max_steps < std::numeric_limits<std::uint64_t>::max();
        return limited ? std::min(options().stall_steps, most) : 0;
    }

    /// Whether the time has hardly advanced since a review that is due, or has, without an event,
    /// advanced so little that not even a hundred times `max_steps` would reach the end. A motion
    /// that keeps the pace that it has had from the start, as an oscillation does, does not stand
    /// still in this sense, however far the end lies.
    [[nodiscard]] bool stands_still() const noexcept
    {
        const Statistics& counts = result().statistics;
        if (engine_.is_endless()) {
            const double so_far = std::fabs(now().until(options().t_start));
            return counts.steps >= stall_review_.due &&
                   std::fabs(now().until(stall_review_.t)) < 1e-6 * so_far;
        }
        const double span = std::fabs(options().t_end - options().t_start);
        const double so_far = std::fabs(now().until(options().t_start));
        const auto advances_less = [&](const Review& since, double part) {
            const double advance = std::fabs(now().until(since.t));
            const auto steps = static_cast<double>(counts.steps - since.steps);
            const bool shrunk = advance < 1e-6 * steps * first_step_;
            return advance < part * span && (shrunk || advance < 1e-6 * so_far);
        };
        const double part =
            static_cast<double>(pace_steps()) / (1e2 * static_cast<double>(options().max_steps));
        const auto is_due = [&](const Review& review) { return counts.steps >= review.due; };
        const bool many_sets = is_due(set_review_) && !is_due(stall_review_) &&
                               engine_.instants() - set_review_.instants >= instants_to_stall();
        return (is_due(stall_review_) && advances_less(stall_review_, 1e-9)) ||
               (many_sets && advances_less(set_review_, 1e-9)) ||
               (is_due(pace_review_) && counts.events == pace_review_.events &&
                advances_less(pace_review_, part));
    }

    /// Number of instants with events that have to advance the time as much as `stall_steps` steps
    /// have to.
    [[nodiscard]] std::uint64_t instants_to_stall() const noexcept
    {
        return std::max<std::uint64_t>(options().stall_steps / 10, 1);
    }

    /// Ends the run after a failed step.
    void end_step(Outcome outcome) noexcept
    {
        if (!now().flow_fits()) return engine_.end(Outcome::wrong_dimension);
        if (outcome == Outcome::non_finite) return engine_.end_not_finite("flow", no_guard);
        engine_.end(outcome);
    }

    void reach_end();

    /// Accepts the step, with a time event at its end if one is due.
    void pass()
    {
        if ((timed_ && engine_.ends_at().time_event) || engine_.ends_at().change) {
            mark_everything();
            const double taken = now().h();
            engine_.keep_flow_at_start();
            accept();
            engine_.apply_at_end(taken);
            return settle_and_record();
        }
        accept();
    }

    void accept();

    // --- steps whose checks may be deferred ---

    [[nodiscard]] bool is_tentative() const noexcept { return defers_ && planner().in_interval(); }

    /// One step with a check of its end, where planning does not pay.
    void advance_with_check(double remaining);

    /// Checks the step that has been taken for all guards.
    void check_all();

    void advance_by_plan(double remaining, const Advance& how);

    void remember_step(double proposed, std::uint64_t rejected);

    /// Whether the next step may also be taken before the interval is closed.
    [[nodiscard]] bool may_go_on(double ends, const Advance& how);

    /// Closes the interval, of which the current step is the last, or goes back to the first step
    /// that could not be closed.
    void close_interval();

    /// Lets the exact detector examine the current step, for the guards in doubt.
    void verify();

    /// Rolls the whole interval back without a check, and continues step by step.
    void take_back()
    {
        const std::size_t accepted = planner().steps().size();
        careful_steps_ = accepted + 1;
        planner().abandon();
        take_back_to(0, accepted);
    }

    /// Goes back to the start of tentative step k. The first `accepted` of them were accepted: all
    /// but one that is still to be closed.
    void take_back_to(std::size_t k, std::size_t accepted);

    [[nodiscard]] bool holds_sample() const noexcept
    {
        const auto& times = options().sample_times;
        return next_sample_ < times.size() &&
               lies_before(times[next_sample_], now().time(now().h()));
    }

    /// Takes a step no longer than `remaining` [s] or the time to the next time event.
    /// False: the run has ended.
    [[nodiscard]] bool take_step(double remaining);

    /// Notes whether the step that has been taken ends at a change that its stepper has located.
    void note_change() noexcept { engine_.ends_at().change = phases_ && now().ends_at_change(); }

    /// Limits the next step to the length that its method allows.
    [[gnu::noinline]] double length_within_reach();

    /// Shortens a step only where the domain of the flow ends within it, at the surface of a guard.
    [[nodiscard]] bool take_fixed_step(double h, bool failed = false);

    /// @param proposed  length of the step if nothing had cut it short
    [[nodiscard]] bool take_controlled_step(double h, double proposed)
    {
        double error = now().attempt(h, options().rtol, options().atol);
        if (jumps_at_end()) error = now().attempt(h, options().rtol, options().atol);
        return retry(h, proposed, rule_.largest, error);
    }

    /// Whether the attempt that ends at a time event has to be repeated, since the flow jumps
    /// there.
    [[nodiscard]] bool jumps_at_end()
    {
        return engine_.ends_at().time_event && now().sees_jump_at_end(time_event());
    }

    /// Repeats an attempt with the given `error`, shorter, until one is accepted; the next step is
    /// at most `largest` times as long.
    [[nodiscard]] bool retry(double h, double proposed, double largest, double error);

    /// The first guard to reach its surface, and the time until then.
    [[nodiscard]] typename Engine::Approach time_to_surface();

    /// The next length to try after one of h that left the domain of the flow or a guard: nine
    /// tenths of the way to a surface that lies within it, else a tenth.
    [[nodiscard]] double shorten_to_surface(double h)
    {
        const double ahead = time_to_surface().ahead;
        return ahead <= h ? 0.9 * ahead : 0.1 * h;
    }

    /// Places an event at the start of the step if the flow cannot be evaluated a step of length h
    /// ahead, and a guard reaches its surface no later than that.
    [[nodiscard]] bool happen_where_flow_ends(double h);

    [[nodiscard]] double smallest_step() const noexcept
    {
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(now().start().value);
        return std::max(options().h_min, std::max(4 * ulp, std::numeric_limits<double>::min()));
    }

    /// Keeps a motion at rest until a time event or the end.
    void hold(double remaining);

    /// Takes a step of a motion in which some components are held.
    void advance_held(double remaining);
    /// Shortens the step to where the flow lifts the guard of a hold. False: the run has ended.
    [[nodiscard]] bool shorten_to_release();
    /// Whether the current step, if it stands, ends where a hold is released.
    [[nodiscard]] bool ends_at_release() const noexcept { return now().h() == release_at_; }
    /// Accepts that step, and releases the hold.
    void pass_to_release();
    // --- phases ---

    /// Lets the phases change after a step, or where the run would end.
    [[gnu::noinline]] void review_phase(bool has_advanced)
    {
        const double t = now().start().value;
        const bool goes_on =
            !has_ended() && phases_->goes_on &&
            phases_->goes_on(system().adapter(), now().mode(), t, now().x0(), has_advanced);
        if (!goes_on) change_phase(has_advanced);
    }
    void change_phase(bool has_advanced);
    /// Goes on from here in another phase: not a start, so that guards keep their sides.
    /// @param h  as in `PhaseVerdict`
    void continue_from(const X& x, Mode mode, double h);

    // --- events ---

    /// Searches for events in the step; true if they have cut it short, or the run has
    /// ended.
    [[nodiscard]] bool handle_events();

    /// Settles everything that happens at one instant, with the state after it in the solution.
    void settle_and_record()
    {
        engine_.settle_all();
        record_restart();
    }

    /// Ends the step before the window of a set, which the next step is to hold as a whole.
    [[gnu::noinline]] void stop_before_window();

    /// Completes what the step has to show before the resets of a set, which may change the flow.
    void show_before_resets();

    /// Searches a step that may hold events, and handles them.
    [[gnu::noinline]] bool search(bool cleared);

    /// Handles a guard that is NaN at the end of the step: repeats the step, shorter, until all
    /// guards are numbers. False: there is no such step, and the run has ended.
    [[nodiscard]] bool return_to_domain();

    /// Repeats the step, shorter, until its polynomial follows the motion inside: an oscillation of
    /// the polynomial alone holds no events. False: the run has ended.
    [[nodiscard]] bool smooth_step();

    /// Whether the polynomial of the step, of length h, does not follow the motion inside, and the
    /// step can be repeated with a tenth of its length.
    [[nodiscard]] bool is_rough(double h) const;

    /// A length at whose end a guard may be a number again: just `beyond` a surface that lies in
    /// the step, if the crossing can be seen there, else before it.
    [[nodiscard]] double shorten_into_domain(bool beyond);

    /// Limits the step after an event at `t` to twice the flight before it, or to the first
    /// step, wherever the end lies. Events that follow immediately shorten it by no more than error
    /// control would at each of them.
    void limit_next_step(double t) noexcept;

    // --- output ---

    void record_step(double s)
    {
        if (options().record_steps && s > 0) {
            result().solution.add(now().time(0), backward_, engine_.shown(now().mode()),
                                  now().dense(), s);
        }
    }
    /// The part of the step before a set at time t, at whose end is x⁻.
    void record_step_to_set(double s, double t)
    {
        if (!options().record_steps || !(s > 0)) return;
        record_step(s);
        result().solution.end_at(t, engine_.before());
    }

    /// Adds the present state to the solution, kept for a length of time [s], which may be zero.
    void record_place(double length);

    /// Adds the state after resets to the solution, of which no step that starts there is part yet.
    void record_restart();

    /// The end of the times that are before an event at t: a sample that only rounding parts from
    /// it is taken after it.
    [[nodiscard]] double before_rounding(double t) const noexcept
    {
        return backward_ ? t + rounding(t) : t - rounding(t);
    }
    /// Whether only rounding parts two times.
    [[nodiscard]] static bool is_rounding(double sample, double t) noexcept
    {
        return std::fabs(sample - t) <= rounding(t);
    }
    [[nodiscard]] static double rounding(double t) noexcept
    {
        return tolerances::of_time * std::fabs(t);
    }
    /// Whether the step starts where a set has happened: the samples there are the state after it.
    [[nodiscard]] bool starts_at_set() const noexcept;
    /// Adds the next sample if only rounding parts it from the events at time t, where the step
    /// starts.
    void emit_sample_with(double t);

    [[nodiscard]] bool lies_before(double t, double end) const noexcept
    {
        return backward_ ? t > end : t < end;
    }

    /// Samples of the current step before the time `end` of its offset s, as events record it.
    void emit_samples(double s, double end)
    {
        if (next_sample_ < options().sample_times.size()) emit_more_samples(s, end);
    }
    [[gnu::noinline]] void emit_more_samples(double s, double end);

    /// Samples of a state that stays constant, before the time `until`.
    void emit_held_samples(double until);
    /// Samples at the time at which the run has ended.
    void emit_last_samples();

    /// @param offset  [s] in the step
    void add_sample(X&& x, double offset);
    /// Adds the reactions of a sample.
    void add_reaction(double t, const X& x, double offset);
    /// The reactions at time t, where the state is x: s [s] after the start of a step.
    [[nodiscard]] std::vector<double> reaction_at(const PhasePlace<X>& place) const;
    /// The reactions at the end of the last step.
    [[nodiscard]] std::vector<double> reaction_here() const;

    // --- saving ---

    template <class Visitor>
    void visit_state(Visitor&& visit);

    /// What ended the run, if it has ended.
    template <class Visitor>
    void visit_cause(Visitor&& visit);
    template <class Visitor>
    void visit_phases(Visitor&& visit);
    /// Lets a run continue that ended because it was cancelled, at an end before that of the
    /// options, at a limit on its steps that is not reached here, or stalled.
    void reopen() noexcept;

    /// The next sample is the first that is neither in the past nor already written.
    template <class Visitor>
    void visit_samples(Visitor&& visit);

    static constexpr ErrorRule rule_{};

    const RunBindings<X>& setup_;
    const PhaseTable<X>* phases_;
    bool error_controlled_;
    bool guarded_;  ///< has guards, even if their number is zero so far
    bool timed_;
    std::conditional_t<single, Never, bool> defers_;  ///< only the loop of any number plans
    bool backward_;
    Engine engine_;
    std::size_t components_;         ///< number of components of the state at the start
    QuietKernel<X> quiet_;           ///< null: the loop takes every step itself
    double first_step_ = 0;          ///< [s] length of the first step
    double flight_start_ = 0;        ///< [s] time of the last event
    double longest_step_ = 0;        ///< [s] limit on the steps after it
    std::size_t careful_steps_ = 0;  ///< number of steps still to take without looking ahead
    std::uint64_t next_review_ = 0;  ///< number of steps at which to compare with the options
    Review stall_review_, set_review_, pace_review_;
    bool is_last_ = false;
    double release_at_ = infinity;  ///< [s] offset at which hold number `released_` is lifted
    std::size_t released_ = 0;
    std::size_t next_sample_ = 0;
    std::size_t shown_samples_ = 0;  ///< number of samples shown by `advance`
    std::size_t shown_records_ = 0;  ///< and of events among those recorded
    std::uint64_t shown_events_ = 0;
    Showing showing_ = Showing::step;
    bool over_ = false;  ///< the result has been handed out
    Mode sample_mode_ = 0;
    ShownStep shown_step_;
    StepStart<X> place_;
    double last_of_flow_ = 0;     ///< of that place, see `Step::last_of_flow`
    std::unique_ptr<Mark> mark_;  ///< null: the run does not continue after an exception
};

}  // namespace ricochet::detail
