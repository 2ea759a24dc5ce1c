// A run in progress: smooth steps, events, resets, until the end or a reason to stop.
//
//     step from (t, x)              the method, as a departure from the tangent
//     guards at its end             screened, all at once
//     search                        the first set of events in the step
//     resets                        x⁻ becomes x⁺, the mode may change
//     arming                        every guard anew; who was flipped fires in turn
//
// Steps are half-open, (t, t + h]. A system without a guard compiles to the step
// alone. Between the first step and the last nothing is allocated for states of
// fixed size, unless something is recorded.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/event_search.hpp"
#include "core/guard_bank.hpp"
#include "core/initial_step.hpp"
#include "core/merged_resets.hpp"
#include "core/metering.hpp"
#include "core/planner.hpp"
#include "core/step.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/refusals.hpp"
#include "ricochet/detail/step_control.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/integrate/run.hpp"
#include "ricochet/integrate/snapshot.hpp"

namespace ricochet::detail {

/// What a `Core` needs of a loop, whatever it has been compiled for.
template <class X>
class AnyLoop {
public:
    AnyLoop() = default;
    AnyLoop(const AnyLoop&) = delete;
    AnyLoop& operator=(const AnyLoop&) = delete;
    virtual ~AnyLoop() = default;

    [[nodiscard]] virtual double t() const noexcept = 0;
    [[nodiscard]] virtual const X& x() const noexcept = 0;
    [[nodiscard]] virtual Mode mode() const noexcept = 0;
    [[nodiscard]] virtual bool ended() const noexcept = 0;
    [[nodiscard]] virtual const Run<X>& run() const noexcept = 0;
    [[nodiscard]] virtual MeterReading meter() const = 0;
    virtual bool step() = 0;
    virtual bool advance() = 0;
    virtual void show_all() noexcept = 0;
    virtual void advance_once(bool look_ahead) = 0;
    [[nodiscard]] virtual Run<X> take() = 0;
    [[nodiscard]] virtual Run<X> finish() = 0;
    [[nodiscard]] virtual Snapshot save() = 0;
    virtual void restore(const Snapshot& snapshot) = 0;
};

template <class X, bool single>
class Loop final : public AnyLoop<X> {
    static constexpr double infinity = std::numeric_limits<double>::infinity();

public:
    Loop(const RunSetup<X>& setup, const X& x0, const Options& options)
        : setup_(setup),
          system_(*setup.system, setup.door),
          finders_{setup.detector, setup.detecting, setup.locator, setup.locating},
          error_controlled_(setup.error_controlled),
          guarded_(system_->guarded),
          resets_any_(system_->resets()),
          timed_(system_->timed()),
          puts_off_(setup.detector.puts_off),
          predicts_(setup.detector.clears != nullptr),
          options_(checked(options, x0)),
          meter_(puts_off_ ? nullptr : setup.detector.metering),
          resolution_(options),
          backward_(options.t_end < options.t_start),
          components_(static_cast<std::size_t>(x0.size())),
          step_(system_, *setup.kernel, options.t_start, x0, options.mode, backward_),
          bank_(system_, BankRules::of(setup.detector, system_), backward_),
          search_(x0, bank_.size(), finders_, resolution_),
          resets_(x0)
    {
        if (puts_off_) planner_.emplace(system_, finders_, x0, backward_, bank_.size());
        h_next_ = options_.step > 0 ? options_.step : std::fabs(options_.t_end - options_.t_start);
        if (error_controlled_) {
            if (step_.error_order() == 0) throw_no_error_estimate();
            if (options_.step == 0) h_next_ = initial_step(step_, options_);
            h_next_ = std::min(h_next_, options_.h_max);
        }
        first_step_ = h_next_;
        flight_start_ = options_.t_start;
        refuse_bad_modes();
        if (!step_.flow_fits()) throw_flow_does_not_fit(components_);
        if (guarded_) refuse_bad_guards();
        if (system_->forward_only && backward_) throw_forward_only();
        if (timed_) {
            if (backward_ && !system_->previous_time_event) throw_no_previous_time_event();
            find_time_event(true);
        }
        if (setup.detector.check) {
            const double smallest = error_controlled_ ? options_.h_min : options_.step;
            const double largest = error_controlled_ ? options_.h_max : options_.step;
            setup.detector.check(setup.detecting, setup.door, x0, smallest, largest);
        }
        if (guarded_) arm_at_start();
    }
    [[nodiscard]] double t() const noexcept override  ///< [s]
    {
        return showing_sample_ ? run_.trajectory.t[shown_samples_ - 1] : step_.start().value;
    }
    [[nodiscard]] const X& x() const noexcept override
    {
        return showing_sample_ ? run_.trajectory.x[shown_samples_ - 1] : step_.x0();
    }
    [[nodiscard]] Mode mode() const noexcept override
    {
        return showing_sample_ ? sample_mode_ : step_.mode();
    }
    [[nodiscard]] bool ended() const noexcept override { return ended_; }
    /// What has been computed so far; its time and state are brought up to date by
    /// `finish`.
    [[nodiscard]] const Run<X>& run() const noexcept override { return run_; }

    /// Of a `Metered` detector: what asking its network has cost and saved so far.
    [[nodiscard]] MeterReading meter() const override
    {
        return puts_off_ ? planner_->meter().reading() : meter_.reading();
    }

    /// Takes one step, with whatever events it holds. False: the run has ended. A detector
    /// that puts off checks does not look ahead here, since every step is final.
    bool step() override
    {
        show_all();
        if (!ended_) advance_one({.look_ahead = false});
        return !ended_;
    }

    /// Goes on to the next sample time, or to the end of the next step that holds events;
    /// `t`, `x` and `mode` are those there, after the events. False: the run has ended, and
    /// nothing has happened in it that was not shown.
    bool advance() override
    {
        for (;;) {
            showing_sample_ = shown_samples_ < run_.trajectory.t.size();
            if (showing_sample_) {
                ++shown_samples_;
                return true;
            }
            if (std::exchange(shown_events_, run_.statistics.events) != run_.statistics.events) {
                return true;
            }
            if (ended_) return false;
            do {
                advance_one({.to_next_sample = true});
            } while (!ended_ && is_tentative());
        }
    }

    /// One step that may end in the middle of a stretch of tentative steps if it looks ahead.
    void advance_once(bool look_ahead) override { advance_one({.look_ahead = look_ahead}); }

    /// `advance` shows only what happens from here on.
    void show_all() noexcept override
    {
        shown_samples_ = run_.trajectory.t.size();
        shown_events_ = run_.statistics.events;
        showing_sample_ = false;
    }

    /// Goes on to the end and hands over all that was computed.
    [[nodiscard]] Run<X> take() override
    {
        while (!ended_) {
            // Where one event follows the other a quiet run would be over at its first step.
            const std::uint64_t events = run_.statistics.events;
            if (calm_ && may_run_quietly() && run_quietly()) continue;
            advance_one({});
            calm_ = run_.statistics.events == events;
        }
        return finish();
    }

    /// Hands over what has been computed so far; before the end its outcome is `cancelled`. The
    /// simulation is over.
    [[nodiscard]] Run<X> finish() override
    {
        if (!ended_) run_.outcome = Outcome::cancelled;
        run_.t = step_.start().value;
        run_.x = step_.x0();
        run_.mode = step_.mode();
        run_.statistics.flow_calls = step_.flow_calls();
        run_.statistics.resteps = step_.resteps();
        if (puts_off_) planner_->add_counts(run_.statistics);
        run_.statistics.disabled += search_.disabled;
        emit_held_samples(std::nextafter(run_.t, backward_ ? -infinity : infinity));
        ended_ = true;
        return std::move(run_);
    }

    /// All that the future depends on. A simulation of the same system with the same
    /// options, stepping, detector and locator that restores it goes on with the same
    /// bits; only its end, its sample times and what it records may be others. What was
    /// recorded is not part of it.
    [[nodiscard]] Snapshot save() override
    {
        Snapshot snapshot;
        snapshot.run = properties();
        visit_state(SnapshotWriter(snapshot));
        return snapshot;
    }

    /// @throws std::invalid_argument naming what does not agree if the snapshot is of another
    /// run, or no state of one; then nothing has changed.
    void restore(const Snapshot& snapshot) override
    {
        const Snapshot old = save();
        require_same_run(snapshot.run, old.run);
        try {
            SnapshotReader reader(snapshot);
            visit_state(reader);
            reader.finish();
            refuse_bad_place();
        } catch (const std::invalid_argument&) {
            visit_state(SnapshotReader(old));
            throw;
        }
        step_.restart(place_);
        next_review_ = 0;
        show_all();
        if (guarded_) search_.begin(step_.x0());
        if (puts_off_) planner_->restore(bank_);
    }

private:
    // --- set-up ---

    const Options& checked(const Options& options, const X& x0) const
    {
        validate(options, !error_controlled_);
        if (x0.size() == 0) throw_start_empty();
        for_each_component(x0, [&](auto i) {
            if (!std::isfinite(x0[i])) {
                throw_start_not_finite(static_cast<std::size_t>(i), x0[i]);
            }
        });
        return options;
    }

    [[nodiscard]] std::vector<RunProperty> properties() const
    {
        const std::string by_name =
            setup_.method_by_name ? " of order " + std::to_string(step_.order()) : "";
        return properties_of_run({.system = system_->name(system_.door()),
                                  .stepping = plain_type_name(setup_.stepping) + by_name,
                                  .detector = plain_type_name(finders_.detector.type),
                                  .locator = plain_type_name(finders_.locator.type),
                                  .components = components_,
                                  .guards = bank_.size(),
                                  .error_controlled = error_controlled_},
                                 options_);
    }

    /// Of a snapshot that has been read.
    void refuse_bad_place() const
    {
        const auto require = [](bool fulfilled, std::string_view what) {
            if (!fulfilled) throw_snapshot_is_no_state(what);
        };
        const auto components = static_cast<std::size_t>(place_.x.size());
        const bool may_shrink =
            (system_->moded || system_->changes_dimension) && !system_->fixed_dimension;
        require((system_->fixed_dimension ? components == components_
                                          : components >= (may_shrink ? 1 : components_)) &&
                    place_.remainder.size() == place_.x.size() &&
                    place_.rate.size() == place_.x.size(),
                "the number of components");
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(place_.t.value);
        require(std::isfinite(place_.t.value) && std::fabs(place_.t.remainder) <= ulp &&
                    !lies_before(options_.t_end, place_.t.value) &&
                    !lies_before(place_.t.value, options_.t_start),
                "the time");
        require(ended_ || (all_finite(place_.x) && all_finite(place_.remainder) &&
                           all_finite(place_.rate)),
                "the state");
        require(h_next_ > 0 && std::isfinite(h_next_) &&
                    (!error_controlled_ || h_next_ <= options_.h_max),
                "the next step");
        require(first_step_ > 0 && std::isfinite(first_step_), "the first step");
        require(std::isfinite(flight_start_) && longest_step_ >= 0 && std::isfinite(longest_step_),
                "the last event");
        require(ended_ || lies_before(place_.t.value, time_event_) || !timed_,
                "the next time event");
        const std::size_t modes = system_.modes();
        require(modes == 0 || place_.mode < modes, "the mode");
    }

    void refuse_bad_modes() const
    {
        const std::size_t modes = system_.modes();
        if (modes > 0 && options_.mode >= modes) throw_unknown_mode(options_.mode, modes);
    }

    void refuse_bad_guards()
    {
        for (std::size_t i = 0; i < bank_.size(); ++i) {
            GuardRecord& record = bank_[i];
            const GuardInfo& info = record.info;
            record.acting =
                (resets_any_ && info.resets) || info.stop_after > 0 || options_.stop_at_event;
            if (info.unilateral && !(resets_any_ && info.resets)) {
                throw_no_reset(i, info.name);
            }
            if (info.unilateral && info.crossing != Crossing::falling) {
                throw_unilateral_not_falling(i, info.name);
            }
        }
    }

    void arm_at_start()
    {
        enable_guards();
        newly_armed_ = true;
        last_h_ = h_next_;
        bank_.begin_phase(step_.time(0));
        bank_.sample_start(step_, calls(), h_next_);
        for (std::size_t i = 0; i < bank_.size(); ++i) {
            const GuardRecord& record = bank_[i];
            const double g = bank_.g0(i);
            if (!record.enabled) continue;
            if (!std::isfinite(g)) {
                throw_start_guard_not_finite(i, record.info.name, options_.t_start, g);
            }
            const bool on_surface =
                g == 0 || (record.info.unilateral && g < 0 && -g <= rounding_of(i));
            if (record.info.unilateral && g < 0 && !on_surface) {
                throw_start_outside_mode(i, record.info.name, options_.t_start, g);
            }
            if (on_surface) bank_[i].band = std::fabs(g);
            bank_[i].departs = on_surface;
            bank_.arm(i, on_surface ? heading(i) : side_of(g));
            if (record.side == Side::plateau) {
                bank_.await(i, record.info.unilateral ? Side::above : Side::plateau);
            }
            if (record.info.unilateral && record.side == Side::below) {
                search_.members().push_back(i);
            }
        }
        cascade();
    }

    /// What rounding of the time and of the state, 8 units in the last place of each
    /// component, may make of guard i at the start of the step.
    [[nodiscard]] double rounding_of(std::size_t i)
    {
        constexpr double nudge = 8 * std::numeric_limits<double>::epsilon();
        const auto guard = bank_.view(i, step_.mode(), calls());
        const double t = step_.time(0);
        const double g = guard.value(t, step_.x0());
        double rounding = std::fabs(guard.value(t * (1 + nudge), step_.x0()) - g);
        X near = step_.x0();
        for_each_component(near, [&](auto c) {
            const double kept = near[c];
            if (kept == 0) return;
            near[c] = kept * (1 + nudge);
            rounding += std::fabs(guard.value(t, near) - g);
            near[c] = kept;
        });
        return rounding;
    }

    // --- steps ---

    [[nodiscard]] std::uint64_t& calls() noexcept { return run_.statistics.guard_calls; }

    void end(Outcome outcome, std::size_t guard = no_guard) noexcept
    {
        run_.outcome = outcome;
        run_.guard = guard;
        ended_ = true;
    }

    /// What a detector that puts off checks may do.
    struct Advance {
        bool look_ahead = true;       ///< take steps that are closed only later
        bool to_next_sample = false;  ///< but none beyond one with a sample time
    };

    /// One step, with whatever events it holds.
    void advance_one(const Advance& how)
    {
        const double remaining = step_.until(options_.t_end);
        if (!(remaining > 0)) return reach_end();
        if (run_.statistics.steps >= next_review_ && !may_take_more_steps()) return;
        if (options_.cancelled && options_.cancelled->load(std::memory_order_relaxed)) {
            if (is_tentative()) take_back();
            return end(Outcome::cancelled);
        }
        if (resting_) return hold(remaining);
        if (puts_off_) return advance_by_plan(remaining, how);
        if (!take_step(remaining)) return;
        if (guarded_ && handle_events()) return;
        pass();
    }

    // --- steps in a row in which nothing happens ---

    [[nodiscard]] bool may_run_quietly() const noexcept
    {
        return setup_.quiet && !resting_ && run_.statistics.steps < next_review_ &&
               !options_.record_steps && next_sample_ >= options_.sample_times.size() &&
               bank_.is_steady();
    }

    /// Goes on until a step deserves a look, and deals with it. False: there is none.
    bool run_quietly()
    {
        const bool time_event_first =
            timed_ && step_.until(time_event_) <= step_.until(options_.t_end);
        QuietRun quiet{.end = time_event_first ? time_event_ : options_.t_end,
                       .rtol = options_.rtol,
                       .atol = options_.atol,
                       .h_min = options_.h_min,
                       .h_max = options_.h_max,
                       .looks = bank_.looks() && options_.look_inside,
                       .most_steps = next_review_ - run_.statistics.steps,
                       .cancelled = options_.cancelled,
                       .h_next = h_next_};
        bank_.lend(quiet);
        setup_.quiet(system_.door(), step_.lend(), quiet);
        bank_.take_back(quiet);
        h_next_ = error_controlled_ || quiet.why == QuietEnd::due ? quiet.h_next : h_next_;
        if (quiet.steps > 0) last_h_ = step_.h();
        Statistics& counts = run_.statistics;
        counts.steps += quiet.steps;
        counts.rejected += quiet.rejected;
        counts.guard_calls += quiet.guard_calls;
        if (bank_.size() > 0) add_evidence(finders_.detector.evidence, quiet.steps);
        if (quiet.why == QuietEnd::due) return false;
        is_last_ = time_event_due_ = asked_ = false;
        if (quiet.why == QuietEnd::failed) {
            const double h = step_.h();
            const bool taken =
                error_controlled_
                    ? retry(h, h, quiet.repeated ? 1 : rule_.largest, quiet.error)
                    : take_fixed_step(h, true);
            if (!taken || (guarded_ && handle_events())) {
                calm_ = false;
                return true;
            }
        } else if (deserves_search(quiet.why == QuietEnd::moving)) {
            if (search(false)) {
                calm_ = false;
                return true;
            }
        } else {
            add_evidence(finders_.detector.evidence, 1);
            bank_.pass_on();
        }
        pass();
        return true;
    }

    /// Whether the run may go on after as many steps; decides when it is asked next.
    [[gnu::noinline]] bool may_take_more_steps()
    {
        const std::uint64_t steps = run_.statistics.steps;
        if (steps >= options_.max_steps) {
            end(Outcome::step_limit);
        } else if (next_review_ > 0 && !is_tentative() && stands_still()) {
            end(Outcome::stalled);
        }
        reviewed_ = step_.start().value;
        const std::uint64_t stride = options_.stall_steps;
        next_review_ =
            stride > 0 && options_.max_steps - steps > stride ? steps + stride : options_.max_steps;
        return !ended_;
    }

    /// Whether time has hardly advanced since the last review.
    [[nodiscard]] bool stands_still() const noexcept
    {
        const double span = std::fabs(options_.t_end - options_.t_start);
        return std::fabs(step_.until(reviewed_)) < 1e-9 * span;
    }

    /// A failure of a step, or what lies behind it.
    void end_step(Outcome outcome) noexcept
    {
        end(step_.flow_fits() ? outcome : Outcome::wrong_dimension);
    }

    void reach_end()
    {
        if (puts_off_) {
            planner_->look_last(step_, bank_, run_.statistics);
            if (planner_->wrong()) return name_wrong_bound();
        }
        end(Outcome::reached_end);
    }

    /// The step stands, with a time event at its end if one is due.
    void pass()
    {
        if (timed_ && time_event_due_) return happen_on_time();
        accept();
    }

    void accept()
    {
        emit_samples(step_.h());
        record_step(step_.h());
        if (is_last_) {
            step_.accept_at(options_.t_end);
        } else if (time_event_due_) {
            step_.accept_at(time_event_);
        } else {
            step_.accept();
        }
        last_h_ = step_.h();
        ++run_.statistics.steps;
    }

    // --- steps whose checks may be put off ---

    [[nodiscard]] bool is_tentative() const noexcept
    {
        return puts_off_ && planner_->in_stretch();
    }

    /// One step with a look at its end, where planning does not pay.
    void advance_with_check(double remaining)
    {
        if (!watching_) bank_.wake_all(step_, last_h_, calls(), newly_armed_);
        watching_ = newly_armed_ = true;
        planner_->look_back(run_.statistics);
        if (!take_step(remaining)) return;
        if (handle_events()) return;
        pass();
    }

    void advance_by_plan(double remaining, const Advance& how)
    {
        if (planner_->steps_aside()) return advance_with_check(remaining);
        if (newly_armed_) {
            newly_armed_ = watching_ = false;
            planner_->begin(step_, bank_);
        }
        const double proposed = h_next_;
        const std::uint64_t rejected = run_.statistics.rejected;
        if (!take_step(remaining)) {
            if (is_tentative()) {
                // The failure may lie beyond an event: without looking ahead it will be seen.
                ended_ = false;
                run_.outcome = Outcome::reached_end;
                take_back();
            }
            return;
        }
        const double t = step_.time(step_.h());
        const double ends = backward_ ? -t : t;
        if (planner_->covers(ends)) {
            planner_->sample_sleeper(step_, bank_, run_.statistics);
            if (planner_->wrong()) return name_wrong_bound();
            count_put_off(1);
            return pass();
        }
        remember_step(proposed, rejected);
        planner_->overrun(ends);
        if (may_go_on(ends, how)) return accept();
        close_stretch();
    }

    void remember_step(double proposed, std::uint64_t rejected)
    {
        auto& tentative = planner_->steps().add();
        step_.store(tentative.start);
        tentative.h_next = proposed;
        tentative.last_h = last_h_;
        tentative.samples = next_sample_;
        tentative.pieces = run_.solution.size();
        tentative.rejected = rejected;
    }

    /// Whether the next step, too, may be taken before the stretch is closed.
    [[nodiscard]] bool may_go_on(double ends, const Advance& how)
    {
        if (careful_steps_ > 0) {
            --careful_steps_;
            return false;
        }
        const bool must_close =
            !how.look_ahead || planner_->steps().full() || is_last_ || time_event_due_ ||
            run_.statistics.steps + 1 >= options_.max_steps ||
            (how.to_next_sample && holds_sample()) || !planner_->hopes(ends + h_next_);
        return !must_close;
    }

    /// The step in hand is the last of its stretch: closes it, or goes back to the first step
    /// that could not be closed.
    void close_stretch()
    {
        const std::size_t steps = planner_->steps().size();
        const std::size_t doubt = planner_->close(step_, bank_, run_.statistics, h_next_);
        if (planner_->wrong()) {
            if (doubt != Planner<X, single>::none && doubt + 1 < steps) take_back_to(doubt);
            return name_wrong_bound();
        }
        if (doubt == Planner<X, single>::none) {
            count_put_off(steps);
            planner_->steps().clear();
            return pass();
        }
        count_put_off(doubt);
        if (doubt + 1 < steps) return take_back_to(doubt);
        planner_->steps().clear();
        judge();
    }

    /// The exact detector looks at the step in hand, for the guards in doubt.
    void judge()
    {
        planner_->wake(step_, bank_, run_.statistics, last_h_);
        bool suspicious = false;
        for (const std::size_t i : planner_->judged()) {
            suspicious = suspicious || bank_.suspicious(i, step_.h());
        }
        if (suspicious) {
            if (search(false)) return;
        } else {
            run_.statistics.evidence.add(finders_.detector.evidence);
            for (const std::size_t i : planner_->judged()) bank_.leave_plateau(i);
        }
        planner_->settle(step_, bank_);
        if (planner_->wrong()) return name_wrong_bound();
        pass();
    }

    void name_wrong_bound()
    {
        run_.wrong_bound = planner_->wrong();
        end(Outcome::wrong_bound, run_.wrong_bound->guard);
    }

    void count_put_off(std::size_t steps) noexcept
    {
        run_.statistics.checks_put_off += steps;
        add_evidence(finders_.detector.put_off, steps);
    }

    void add_evidence(Evidence evidence, std::uint64_t steps) noexcept
    {
        EvidenceCounts& counts = run_.statistics.evidence;
        switch (evidence) {
            case Evidence::proved: counts.proved += steps; return;
            case Evidence::checked: counts.checked += steps; return;
            case Evidence::gated: counts.gated += steps; return;
            case Evidence::assumed: counts.assumed += steps; return;
        }
    }

    /// Takes back the whole stretch, without having looked, and goes on carefully.
    void take_back()
    {
        careful_steps_ = planner_->steps().size() + 1;
        planner_->abandon();
        take_back_to(0);
    }

    /// Goes back to the start of tentative step k.
    void take_back_to(std::size_t k)
    {
        const auto& tentative = planner_->steps()[k];
        // The step in hand has not been accepted.
        const std::size_t taken = planner_->steps().size() - 1 - k;
        ++run_.statistics.rollbacks;
        run_.statistics.repeated_steps += taken;
        run_.statistics.steps -= taken;
        run_.statistics.rejected = tentative.rejected;
        step_.restart(tentative.start);
        h_next_ = tentative.h_next;
        last_h_ = tentative.last_h;
        for (; next_sample_ > tentative.samples; --next_sample_) {
            run_.trajectory.t.pop_back();
            run_.trajectory.x.pop_back();
        }
        run_.solution.shrink(tentative.pieces);
        planner_->steps().clear();
    }

    [[nodiscard]] bool holds_sample() const noexcept
    {
        const auto& times = options_.sample_times;
        return next_sample_ < times.size() &&
               lies_before(times[next_sample_], step_.time(step_.h()));
    }

    /// Takes a step no longer than `remaining` [s] or the time to the next time event.
    /// False: the run has ended.
    [[nodiscard]] bool take_step(double remaining)
    {
        double longest = remaining;
        time_event_due_ = false;
        if (timed_) {
            const double ahead = step_.until(time_event_);
            if (ahead <= remaining) {
                longest = ahead;
                // A remainder of a millionth of a step is rounding, not a step.
                time_event_due_ = h_next_ * (1 + 1e-6) >= longest;
            }
        }
        const bool to_the_end = h_next_ * (1 + 1e-6) >= longest;
        is_last_ = to_the_end && longest == remaining;
        const double h = to_the_end ? longest : h_next_;
        return error_controlled_ ? take_controlled_step(h, h_next_) : take_fixed_step(h);
    }

    /// Shorter only where the setup ends within the step, at the surface of a guard.
    [[nodiscard]] bool take_fixed_step(double h, bool failed = false)
    {
        for (;;) {
            if (!std::exchange(failed, false) && step_.attempt(h)) return true;
            const double ahead = time_to_surface().ahead;
            if (!(ahead <= h)) break;
            if (ahead < smallest_step()) {
                if (happen_where_flow_ends(h)) return false;
                break;
            }
            is_last_ = time_event_due_ = false;
            h = 0.9 * ahead;
        }
        end_step(Outcome::non_finite);
        return false;
    }

    /// `proposed`: what the step would have been if nothing had cut it short.
    [[nodiscard]] bool take_controlled_step(double h, double proposed)
    {
        const double error = step_.attempt(h, options_.rtol, options_.atol);
        return retry(h, proposed, rule_.largest, error);
    }

    /// Repeats an attempt of `error`, shorter, until one is accepted; the next step is at most
    /// `largest` times as long.
    [[nodiscard]] bool retry(double h, double proposed, double largest, double error)
    {
        const int order = step_.error_order() + 1;
        for (;;) {
            if (rule_.accepts(error)) {
                const double next = h * std::min(largest, rule_.factor(error, order));
                const bool cut = largest > 1 && h < proposed;
                h_next_ = std::min(cut ? std::max(next, proposed) : next, options_.h_max);
                return true;
            }
            ++run_.statistics.rejected;
            const bool finite = std::isfinite(error);
            h = finite ? h * rule_.factor(error, order) : shorten_to_surface(h);
            is_last_ = false;
            time_event_due_ = false;
            largest = 1;
            if (h < smallest_step()) {
                if (happen_where_flow_ends(h)) return false;
                end_step(finite ? Outcome::step_underflow : Outcome::non_finite);
                return false;
            }
            error = step_.attempt(h, options_.rtol, options_.atol);
        }
    }

    /// A guard that acts or records, and when it reaches its surface at its present rate.
    struct Approach {
        std::size_t guard = no_guard;
        double ahead = infinity;  ///< [s]
    };

    /// The first guard to reach its surface in the direction that counts.
    [[nodiscard]] Approach time_to_surface()
    {
        Approach first;
        if (puts_off_) return first;
        for (std::size_t i = 0; i < bank_.size(); ++i) {
            const GuardRecord& record = bank_[i];
            if (!record.enabled || record.info.boolean) continue;
            if (!counts(record.side, record.info.crossing)) continue;
            const double g = bank_.g0(i);
            const double rate = approach_rate(i);
            const double ahead = g * rate < 0 ? -g / rate : infinity;
            if (ahead < first.ahead) first = {i, ahead};
        }
        return first;
    }

    [[nodiscard]] double approach_rate(std::size_t i)
    {
        double rate = bank_.complete_rate0(i, step_, h_next_, calls());
        if (!system_->rated) {
            // Over a short step the rounding of the state may swallow the difference.
            double scale = h_next_;
            for (int k = 0; rate == 0 && k < 12; ++k) rate = departure(i, scale *= 16);
        }
        return rate;
    }

    /// The next length to try after one of h that left the domain of the flow or a guard: nine
    /// tenths of the way to a surface that lies within it, else a tenth.
    [[nodiscard]] double shorten_to_surface(double h)
    {
        const double ahead = time_to_surface().ahead;
        return ahead <= h ? 0.9 * ahead : 0.1 * h;
    }

    /// The flow ends here, as it cannot be evaluated a step of h further on, and a guard reaches
    /// its surface no later: its event happens at the start of the step.
    [[nodiscard]] bool happen_where_flow_ends(double h)
    {
        if (puts_off_) return false;
        const Approach approach = time_to_surface();
        const std::size_t i = approach.guard;
        if (!(approach.ahead <= 16 * std::max(h, smallest_step())) || !counts_here(i)) return false;
        if (!bank_[i].acting) {
            record_jump(i, bank_[i].side);
            return false;
        }
        for (std::size_t k = 0; k < bank_.size(); ++k) bank_[k].band = 0;
        bank_[i].band = std::fabs(bank_.g0(i));
        search_.members().clear();
        search_.members().push_back(i);
        cascade();
        return true;
    }

    [[nodiscard]] double smallest_step() const noexcept
    {
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(step_.start().value);
        return std::max(options_.h_min, std::max(4 * ulp, std::numeric_limits<double>::min()));
    }

    /// A mode-less system at rest stays as it is, until a time event or the end.
    void hold(double remaining)
    {
        double until = options_.t_end;
        time_event_due_ = false;
        if (timed_) {
            time_event_due_ = step_.until(time_event_) <= remaining;
            if (time_event_due_) until = time_event_;
        }
        emit_held_samples(until);
        step_.hold(until);
        if (time_event_due_) {
            step_.refresh();
            apply_time_event();
        }
    }

    // --- time events ---

    /// One that is not ahead would be lost, with all that follow it.
    void find_time_event(bool at_start = false)
    {
        if (!timed_) return;
        const double t = step_.start().value;
        if (!backward_) {
            time_event_ = system_->next_time_event(system_.door(), t);
        } else if (system_->previous_time_event) {
            time_event_ = system_->previous_time_event(system_.door(), t);
        }
        if (step_.until(time_event_) > 0) return;
        if (at_start) throw_time_event_not_ahead(backward_, t, time_event_);
        end(Outcome::time_event_not_ahead);
    }

    /// The step has ended at a time event.
    void happen_on_time()
    {
        accept();
        apply_time_event();
    }

    void apply_time_event()
    {
        for (std::size_t i = 0; i < bank_.size(); ++i) bank_[i].band = 0;
        search_.members().clear();
        assign(search_.before(), step_.x0());
        transform(true);
        resting_ = resting_ && resets_.mode() == step_.mode() &&
                   same_state(resets_.after(), step_.x0());
        fire({.located = false, .on_time = true});
        if (!ended_) find_time_event();
        if (guarded_) cascade();
    }

    // --- events ---

    /// Looks for events in the step; true if they have cut it short, or the run has
    /// ended.
    [[nodiscard]] bool handle_events()
    {
        bool cleared = false;
        if (predicts_) {
            meter_.look_back(run_.statistics);
            asked_ = meter_.asks();
            if (asked_) cleared = ask_network();
            if (cleared && !finders_.detector.checks_every_step) {
                ++run_.statistics.checks_put_off;
                run_.statistics.evidence.add(Evidence::assumed);
                return false;
            }
        }
        if (bank_.size() == 0) return false;
        bank_.sample_end(step_, calls());
        if (!any_suspicious()) {
            if (asked_ && !cleared) ++run_.statistics.false_alarms;
            run_.statistics.evidence.add(finders_.detector.evidence);
            bank_.pass_on();
            return false;
        }
        return search(cleared);
    }

    /// Whether any guard deserves a search. Detectors that ask for it see the guards inside
    /// the step, too; a second time where the first leaves doubts.
    [[nodiscard]] bool any_suspicious()
    {
        if (!bank_.looks() || !options_.look_inside) return bank_.suspicious(step_.h());
        look_inside();
        return deserves_search(error_controlled_ && hardly_moves());
    }

    /// The same after a look inside, if there is one; `moves` hardly: at several places more.
    [[nodiscard]] bool deserves_search(bool hardly_moves)
    {
        if (!bank_.looked()) return bank_.suspicious(step_.h());
        if (hardly_moves) {
            X& x = search_.space(step_.x0());
            for (const double u : CubicLook::places) {
                step_.peek(u * step_.h(), x);
                bank_.sample_place(step_, u, x, calls());
            }
            return bank_.suspicious(step_.h());
        }
        if (!bank_.doubtful(step_.h())) return false;
        if (bank_.needs_second_look(step_.h())) {
            X& x = search_.space(step_.x0());
            step_.peek(CubicLook::further * step_.h(), x);
            bank_.sample_further(step_, x, calls());
        }
        return bank_.suspicious(step_.h());
    }

    void look_inside()
    {
        if constexpr (is_small<X> && std::is_trivially_copyable_v<X>) {
            // Components that no guard reads are not computed.
            X x{};
            step_.template peek<InsideOf>(x);
            bank_.sample_inside(step_, x, calls());
        } else {
            X& x = search_.space(step_.x0());
            step_.template peek<InsideOf>(x);
            bank_.sample_inside(step_, x, calls());
        }
    }

    /// Whether the state hardly changes in the step, which error control then does not limit.
    [[nodiscard]] bool hardly_moves() const noexcept
    {
        const X& x0 = step_.x0();
        const X& x1 = step_.x1();
        const auto is_still = [&](auto i) {
            return std::fabs(x1[i] - x0[i]) <= 0x1p-10 * std::fabs(x0[i]);
        };
        if constexpr (is_small<X>) {
            bool still = true;
            for_each_component(x0, [&](auto i) { still &= is_still(i); });
            return still;
        } else {
            for (decltype(x0.size()) i = 0; i < x0.size(); ++i) {
                if (!is_still(i)) return false;
            }
            return true;
        }
    }

    /// Whether the network predicts that the step is free of events.
    [[nodiscard]] bool ask_network()
    {
        ++run_.statistics.network_calls;
        return meter_.time_network(
            [&] {
                return finders_.detector.clears(finders_.detecting, system_.door(), step_.state(),
                                                calls());
            });
    }

    /// The step may hold events: finds out, and deals with them.
    [[gnu::noinline]] bool search(bool cleared)
    {
        if (bank_.first_not_finite() != no_guard) {
            if (!return_to_domain()) return true;
            if (!any_suspicious()) {
                run_.statistics.evidence.add(finders_.detector.evidence);
                bank_.pass_on();
                return false;
            }
        }
        search_.begin(step_.x0());
        if (bank_.waiting()) end_plateaus();
        bank_.begin_search(step_.h());
        while (search_.find_set(step_, bank_, resolution_, time_event_due_, calls())) {
            if (predicts_ && (cleared || search_.late())) ++run_.statistics.missed_events;
            if (search_.late()) ++run_.statistics.late_events;
            dismiss_members();
            if (search_.members().empty()) continue;
            const bool on_time = time_event_due_ && search_.at() == step_.h();
            transform(on_time);
            if (!on_time && changes_nothing()) {
                go_on_past_members();
                continue;
            }
            act(on_time);
            return true;
        }
        note_crossings(step_.h());
        if (search_.notes().empty()) {
            if (asked_ && !cleared) ++run_.statistics.false_alarms;
            run_.statistics.evidence.add(search_.evidence());
        } else {
            record_notes(step_.h());
        }
        count_refined();
        bank_.pass_on_after_events();
        return ended_;
    }

    /// A guard is no number at the end of the step: takes it again, shorter, until all are.
    /// False: there is no such step, and the run has ended.
    [[nodiscard]] bool return_to_domain()
    {
        bool beyond = true;
        for (;;) {
            const std::size_t broken = bank_.first_not_finite();
            if (broken == no_guard) return true;
            const double h = shorten_into_domain(std::exchange(beyond, false));
            if (is_tentative() || h < smallest_step()) {
                if (!is_tentative() && happen_where_flow_ends(h)) return false;
                end(Outcome::non_finite, broken);
                return false;
            }
            ++run_.statistics.rejected;
            is_last_ = time_event_due_ = false;
            h_next_ = error_controlled_ ? h : h_next_;
            step_.attempt(h);
            bank_.sample_end(step_, calls());
        }
    }

    /// A length at whose end a guard may be a number again: `beyond` a surface that lies within
    /// the step by a little, where it can be seen to be crossed, else before it.
    [[nodiscard]] double shorten_into_domain(bool beyond)
    {
        const double h = step_.h();
        const double ahead = time_to_surface().ahead;
        if (ahead > h) return 0.5 * h;
        const double across = ahead + std::min(0.1 * ahead, 0.5 * (h - ahead));
        return beyond && across < h ? across : 0.9 * ahead;
    }

    void count_refined() noexcept
    {
        run_.statistics.refined_steps += search_.refined();
        run_.statistics.unresolved_steps += search_.unresolved();
    }

    [[gnu::noinline]] void end_plateaus()
    {
        for (std::size_t i = 0; i < bank_.size(); ++i) {
            if (bank_.leaves_plateau(i)) search_.end_plateau(step_, bank_, i, calls());
        }
    }

    /// Whether guard i counts at the start of the step; it is about to fire there.
    [[nodiscard]] bool counts_here(std::size_t i)
    {
        const bool enabled =
            system_.enabled_at(i, step_.mode(), step_.time(0), step_.x0());
        run_.statistics.disabled += !enabled;
        return enabled;
    }

    /// Members whose crossing is no event go on without one: those that `enabled`
    /// rules out, and repeats of an event inside its own window.
    void dismiss_members()
    {
        auto& members = search_.members();
        std::size_t kept = 0;
        for (std::size_t k = 0; k < members.size(); ++k) {
            const std::size_t i = members[k];
            const double t = step_.time(search_.at());
            if (!system_.enabled_at(i, step_.mode(), t, search_.before())) {
                ++run_.statistics.disabled;
            } else if (repeats(i, t) && !bank_[i].info.unilateral && !turned_back(i)) {
                ++run_.statistics.suppressed;
            } else {
                bank_[i].again = repeats(i, t) && turned_back(i);
                members[kept++] = i;
                continue;
            }
            search_.pass(step_, bank_, i, calls());
        }
        members.shrink(kept);
    }

    /// The guard has just had its event in the same direction. If it has not turned back
    /// since, this is the same crossing, seen again because the reset moved the state by a
    /// rounding; else it is a new event, and events accumulate.
    [[nodiscard]] bool repeats(std::size_t i, double t) const noexcept
    {
        const GuardRecord& record = bank_[i];
        return record.side == record.last_side &&
               std::fabs(t - record.last) <= resolution_.window(t);
    }

    [[nodiscard]] bool turned_back(std::size_t i) const noexcept
    {
        return resets_any_ && bank_[i].info.resets && bank_[i].turned;
    }

    /// Computes what the resets of the members make of the state before.
    void transform(bool on_time)
    {
        const double t = on_time ? time_event_ : time_of_set();
        resets_.apply(system_, bank_, search_.members().span(), on_time, step_.mode(), t,
                      search_.before());
    }

    /// Whether the event leaves everything as it was, so that the step can stand.
    [[nodiscard]] bool changes_nothing()
    {
        if (resets_.mode() != step_.mode() || resets_.conflict().first != no_guard) return false;
        for (const std::size_t i : search_.members()) {
            if (bank_[i].info.unilateral || ends_run(i)) return false;
        }
        return same_state(resets_.after(), search_.before());
    }

    /// Whether this event of the guard, not yet counted, ends the run.
    [[nodiscard]] bool ends_run(std::size_t i) const noexcept
    {
        const GuardRecord& record = bank_[i];
        if (options_.stop_at_event) return true;
        return record.info.stop_after > 0 &&
               record.events + search_.noted(i) + 1 >= record.info.stop_after;
    }

    void go_on_past_members()
    {
        for (const std::size_t i : search_.members()) {
            search_.note(i, bank_[i].side);
            search_.pass(step_, bank_, i, calls());
        }
    }

    /// The set that was found cuts the step short.
    void act(bool on_time)
    {
        const double s = search_.at();
        const double t = on_time ? time_event_ : time_of_set();
        for (std::size_t i = 0; i < bank_.size(); ++i) bank_[i].band = 0;
        note_crossings_to_set();
        mode_before_ = step_.mode();
        for (const std::size_t i : search_.members()) find_band(i, t);
        ++run_.statistics.steps;
        count_refined();
        emit_samples(s);
        record_step(s);
        record_notes(s);
        limit_next_step(t);
        fire({.located = true, .on_time = on_time});
        if (on_time && !ended_) find_time_event();
        cascade();
    }

    /// The step after an event at `t` is at most twice the flight before it, or the first
    /// step: no further than what is known of the setup reaches, wherever the end lies. Events
    /// that follow at once shorten it by no more than error control would at each of them.
    void limit_next_step(double t) noexcept
    {
        if (!error_controlled_) return;
        const double flight = std::fabs(t - flight_start_);
        if (flight > resolution_.window(t)) {
            longest_step_ = std::max(2 * flight, rule_.smallest * longest_step_);
            flight_start_ = t;
        }
        h_next_ = std::min(h_next_, std::max(first_step_, longest_step_));
    }

    /// How far from its surface a guard that has just fired may be. A guard with declared
    /// bounds may be dear, and is not asked for what its location says as well.
    void find_band(std::size_t i, double t)
    {
        GuardRecord& record = bank_[i];
        const Location& where = search_.where(i);
        record.jumped = where.jump;
        if (where.jump) {  // the state is beyond, and the guard anything but small
            record.estimated = false;
            record.band = 0;
            return;
        }
        const double residue = 2 * std::fabs(where.slope) * where.error;
        record.estimated = system_->bounded && !record.info.boolean && std::isfinite(residue) &&
                           search_.at() == where.root && !search_.late();
        record.band =
            record.estimated ? std::max(residue, bank_.touch(i, step_.h())) : residue_of(i, t);
    }

    /// |g| where the guard has fired, at the state before.
    [[nodiscard]] double residue_of(std::size_t i, double t)
    {
        return std::fabs(bank_.view(i, mode_before_, calls()).value(t, search_.before()));
    }

    [[nodiscard]] double time_of_set() const noexcept
    {
        return step_.instant(search_.at(), search_.at_remainder()).value;
    }

    struct Firing {
        bool located = false;  ///< inside the current step, else at its start
        bool on_time = false;  ///< with a time event
    };

    /// The members fire: `search_.before()` becomes `resets_.after()`. Leaves who is flipped by
    /// it as the new members.
    void fire(const Firing& how)
    {
        const double s = how.located ? search_.at() : 0;
        const double remainder = how.located ? search_.at_remainder() : 0;
        const double t = how.on_time ? time_event_ : step_.instant(s, remainder).value;
        if (how.on_time) record_time_event(t);
        for (const std::size_t i : search_.members()) record_crossing(i, t, how.located);
        if (!goes_on()) {
            step_.restart(s, remainder, search_.before(), step_.mode());
            return;
        }
        step_.restart(s, remainder, resets_.after(), resets_.mode());
        if (how.on_time) step_.hold(t);
        if (stops_) return end(Outcome::stopped_by_event, first_member());
        if (!guarded_ || resting_ || accumulates(how.located)) return;
        arm_all();
    }

    [[nodiscard]] std::size_t first_member()
    {
        return search_.members().empty() ? no_guard : search_.members()[0];
    }

    /// Whether the resets have left something to go on from; else the run has ended.
    [[nodiscard]] bool goes_on()
    {
        const std::size_t modes = system_.modes();
        if (resets_.conflict().first != no_guard) {
            run_.other_guard = resets_.conflict().second;
            end(Outcome::conflicting_resets, resets_.conflict().first);
        } else if (modes > 0 && resets_.mode() >= modes) {
            end(Outcome::unknown_mode, first_member());
        } else if (!fits_dimension(search_.before(), resets_.after(),
                                   resets_.mode() == step_.mode())) {
            end(Outcome::wrong_dimension, first_member());
        } else if (!all_finite(resets_.after()) || resets_.after().size() == 0) {
            end(Outcome::non_finite, first_member());
        }
        return !ended_;
    }

    [[nodiscard]] bool fits_dimension(const X& before, const X& after, bool same_mode) const
    {
        return system_.fits_dimension(before, after, same_mode);
    }

    /// Whether the events of a member accumulate here. It comes to rest, or the run
    /// ends.
    [[nodiscard]] bool accumulates(bool located)
    {
        bool rested = false;
        for (const std::size_t i : search_.members()) {
            ShrinkingIntervals& intervals = bank_[i].intervals;
            const bool again = std::exchange(bank_[i].again, false);
            const bool stalls = intervals.stalls(step_.start(), h_next_) || again;
            const double tolerance = resolution_.tolerance(step_.start().value);
            const bool resetting = resets_any_ && bank_[i].info.resets;
            if (resetting && located) intervals.blame(search_.where(i).error);
            if (stalls || (resetting && (fades(i) || intervals.accumulate(tolerance)))) {
                come_to_rest(i, stalls ? 0 : intervals.remainder(), intervals.error());
                rested = true;
            }
        }
        if (rested && !ended_ && !resting_) arm_all();
        return rested;
    }

    /// Notes how guard i leaves its surface after its reset. True if it is not going to rise
    /// above its rounding any more.
    [[nodiscard]] bool fades(std::size_t i)
    {
        GuardRecord& record = bank_[i];
        record.turned = false;
        record.rated_over = stale;
        record.intervals.depart(infinity, false);
        if (record.info.boolean || !system_.enabled_in(i, step_.mode())) {
            return false;
        }
        double rate = departure(i, h_next_);
        const bool low = record.intervals.is_low_at(rate);
        const double rounding = low ? rounding_of(i) : 0;
        if (low && is_away(i, rounding)) return false;
        bool lost = false;
        if (!system_->rated) {
            if (low) {
                double part = 1e-5 * h_next_;
                if (std::fabs(rate) * part <= rounding) {
                    part = std::max(part, low_part * record.intervals.interval());
                    rate = departure(i, 1e5 * part);
                }
                // A difference of a unit in the last place does not tell which way it goes.
                lost = std::fabs(rate) * part <= rounding / 8;
                if (lost) rate = 0;
            }
        }
        record.departure = rate;
        record.rated_over = low ? stale : h_next_;
        record.turned = lost || sign_of(record.last_side) * rate > 0;
        if (record.turned) record.intervals.depart(rate, low);
        return low && record.intervals.fades(rounding);
    }

    /// Whether the reset has put guard i so far from its surface, on the side it came from, that
    /// it need not rise: not a residue of the location.
    [[nodiscard]] bool is_away(std::size_t i, double rounding)
    {
        GuardRecord& record = bank_[i];
        const double g =
            bank_.view(i, step_.mode(), calls()).value(step_.time(0), step_.x0());
        if (!(sign_of(record.last_side) * g > 1024 * rounding)) return false;
        record.turned = true;
        return true;
    }

    /// The rate [1/s] of guard i at the start of the step; where it is a difference quotient,
    /// over 1e-5 of `scale` [s].
    [[nodiscard]] double departure(std::size_t i, double scale)
    {
        return bank_.view(i, step_.mode(), calls())
            .rate(step_.time(0), step_.x0(), step_.rate0(), scale);
    }

    /// The limit of the events of guard i is `ahead` [s] from here, give or take `error`.
    void come_to_rest(std::size_t i, double ahead, double error)
    {
        if (!system_->rest) return end(Outcome::zeno, i);
        {
            if (resting_ || ended_) return;
            const X before = step_.x0();
            const Mode mode = step_.mode();
            ahead = std::min(ahead, step_.until(options_.t_end));
            if (timed_) ahead = std::min(ahead, step_.until(time_event_));
            const double t = step_.time(ahead);
            X after = before;
            const Mode mode_after = system_->rest(system_.door(), i, mode, t, after);
            ++run_.statistics.events;
            record({.t = t,
                    .kind = EventKind::accumulation,
                    .guard = i,
                    .mode_before = mode,
                    .mode_after = mode_after,
                    .before = before,
                    .after = after,
                    .bracket = {step_.time(0), t},
                    .slope = 0,
                    .error = error});
            const std::size_t modes = system_.modes();
            if (modes > 0 && mode_after >= modes) return end(Outcome::unknown_mode, i);
            if (!fits_dimension(before, after, mode_after == mode)) {
                return end(Outcome::wrong_dimension, i);
            }
            if (!all_finite(after) || after.size() == 0) {
                return end(Outcome::non_finite, i);
            }
            step_.restart(ahead, 0, after, mode_after);
            for (const std::size_t k : search_.members()) {
                bank_[k].rated_over = stale;
            }
            bank_[i].intervals = {};
            bank_[i].band = 0;
            resting_ = bank_.size() == 1 && !system_->moded;
            if (resting_ && !stays_on_surface(i)) end(Outcome::zeno, i);
        }
    }

    /// Whether guard i stays where it is while the state stands still: its surface does not
    /// move. Looked at from a thousandth of the time that is left to all of it.
    [[nodiscard]] bool stays_on_surface(std::size_t i)
    {
        const auto guard = bank_.view(i, step_.mode(), calls());
        const double span = step_.until(options_.t_end);
        const double rounding = rounding_of(i);
        const double g = guard.value(step_.time(0), step_.x0());
        for (const double part : {0.001, 0.0381966, 0.381966, 1.0}) {
            const double later = guard.value(step_.time(part * span), step_.x0());
            if (!(std::fabs(later - g) <= rounding)) return false;
        }
        return true;
    }

    // --- arming ---

    void enable_guards()
    {
        for (std::size_t i = 0; i < bank_.size(); ++i) {
            GuardRecord& record = bank_[i];
            const bool enabled = system_.enabled_in(i, step_.mode());
            record.newly_enabled = enabled && !record.enabled;
            if (record.newly_enabled) record.last = std::numeric_limits<double>::quiet_NaN();
            record.enabled = enabled;
        }
        bank_.heed_enabled();
    }

    /// Arms every guard at the start of a flight. The members have fired and count as
    /// being on their surface up to the residue of their location. Those that the
    /// resets have carried across their surface become the new members.
    void arm_all()
    {
        double widest = 0;
        for (std::size_t i = 0; i < bank_.size(); ++i) bank_[i].fired = false;
        for (const std::size_t i : search_.members()) {
            bank_[i].fired = true;
            widest = std::max(widest, bank_[i].band);
        }
        search_.members().clear();
        if (system_->moded) enable_guards();
        bank_.await_nobody();
        newly_armed_ = true;
        watching_ = false;
        last_h_ = h_next_;
        bank_.begin_phase(step_.time(0));
        bank_.sample_start(step_, calls(), h_next_);
        for (std::size_t i = 0; i < bank_.size(); ++i) {
            if (!bank_[i].enabled) {
                bank_.arm(i, Side::plateau);
                continue;
            }
            if (!arm_one(i, widest)) return;
        }
    }

    /// False: the run has ended.
    [[nodiscard]] bool arm_one(std::size_t i, double widest)
    {
        GuardRecord& record = bank_[i];
        const double g = bank_.g0(i);
        if (!std::isfinite(g)) {
            end(Outcome::non_finite, i);
            return false;
        }
        const Side before = record.side != Side::plateau ? record.side : record.awaited;
        if (record.fired && record.estimated && std::fabs(g) > record.band) {
            record.band = residue_of(i, step_.time(0));
        }
        record.estimated = false;
        const double band = record.newly_enabled ? std::max(widest, record.band) : record.band;
        const bool on_surface = std::fabs(g) <= band;
        record.departs = on_surface || record.fired || record.newly_enabled;
        const Side side = on_surface ? heading(i) : side_of(g);
        bank_.arm(i, side);
        record.from = 0;
        if (side == Side::plateau) {
            const bool begins = record.newly_enabled && record.acting;
            const Side from = record.info.unilateral ? Side::above
                              : begins               ? side_left_by(record.info.crossing, before)
                                                     : before;
            bank_.await(i, record.fired && !record.info.unilateral ? Side::plateau : from);
        }
        const bool kept_out = record.info.unilateral && side == Side::below;
        const bool flipped = side != Side::plateau && side == opposite(before) &&
                             counts(before, record.info.crossing);
        const bool pressed = kept_out && on_surface;
        const bool arrived = on_surface && counts(opposite(side), record.info.crossing);
        const bool fires = record.fired           ? pressed
                           : record.newly_enabled ? record.acting && (arrived || pressed)
                                                  : flipped;
        if (fires && counts_here(i)) {
            if (record.acting) {
                search_.members().push_back(i);
            } else {
                record_jump(i, before);
            }
        }
        const bool is_new = record.fired || record.newly_enabled;
        const bool outside = kept_out && !on_surface && g < 0 && is_new;
        if (outside) end(Outcome::outside_mode, i);
        return !outside;
    }

    /// The side that a crossing which counts leaves; `else_side` where both do.
    [[nodiscard]] static constexpr Side side_left_by(Crossing crossing, Side else_side) noexcept
    {
        return crossing == Crossing::falling  ? Side::above
               : crossing == Crossing::rising ? Side::below
                                              : else_side;
    }

    /// The side that a guard on its surface is about to be on.
    [[nodiscard]] Side heading(std::size_t i)
    {
        const bool known = bank_[i].fired && bank_[i].rated_over == h_next_;
        double rate = known ? bank_[i].departure : bank_.complete_rate0(i, step_, h_next_, calls());
        if (known) bank_.set_rate0(i, rate);
        bank_[i].rated_over = stale;
        if (!system_->rated) {
            if (bank_[i].fired && bank_[i].turned && bank_[i].intervals.is_low()) {
                rate = bank_[i].departure;
                if (rate == 0) {
                    // Too slow to be told: its reset has sent it back, and it has its next event
                    // on the way down again.
                    const Side back = bank_[i].last_side;
                    bank_.set_rate0(i, sign_of(back) * std::numeric_limits<double>::min());
                    return back;
                }
                bank_.set_rate0(i, rate);
            }
        }
        if (bank_[i].info.boolean) return side_of(rate != 0 ? rate : bank_.g0(i));
        if (rate != 0 && bank_[i].fired) return side_of(rate);
        // The second derivative has the sign of the rate a little later. A rate that it
        // undoes within rounding of the time is none; nor is one that is all rounding.
        const double delta = 1e-6 * h_next_;
        X& later = resets_.after();
        X& rate_later = resets_.scratch();
        assign(later, step_.x0());
        assign(rate_later, step_.x0());
        move(later, step_.x0(), delta, step_.rate0());
        step_.flow(delta, later, rate_later);
        const double next = bank_.view(i, step_.mode(), calls())
                                .rate(step_.time(delta), later, rate_later, h_next_);
        const double moment =
            64 * std::numeric_limits<double>::epsilon() * (std::fabs(step_.time(0)) + h_next_);
        double noise = std::fabs(next - rate) * std::min(moment / delta, 0.5);
        if (!system_->rated) {
            if (!bank_[i].fired) noise = std::max(noise, rounding_of(i) / (1e-5 * h_next_));
        }
        if (std::fabs(rate) > noise) return side_of(rate);
        const Side side = std::fabs(next) > noise ? side_of(next) : Side::plateau;
        bank_.set_rate0(i, sign_of(side) * std::numeric_limits<double>::min());
        return side;
    }

    /// Those that were flipped fire in turn, at the same instant, until nobody is.
    void cascade()
    {
        for (int level = 0; !ended_ && !resting_ && !search_.members().empty(); ++level) {
            if (level == most_levels) {
                return end(Outcome::endless_cascade, search_.members()[0]);
            }
            search_.begin(step_.x0());
            assign(search_.before(), step_.x0());
            search_.stay_at_start();
            transform(false);
            const std::size_t stuck = stuck_member();
            if (stuck != no_guard && bank_.g0(stuck) < -bank_[stuck].band) {
                return end(Outcome::outside_mode, stuck);
            }
            if (stuck != no_guard) {
                come_to_rest(stuck, 0, 0);
                if (!ended_ && !resting_) {
                    search_.members().clear();
                    search_.members().push_back(stuck);
                    arm_all();
                    if (still_stuck(stuck)) end(Outcome::zeno, stuck);
                }
                continue;
            }
            fire({});
        }
    }

    /// The rest rule has not stopped the setup into the surface.
    [[nodiscard]] bool still_stuck(std::size_t i) const noexcept
    {
        return bank_[i].info.unilateral && bank_[i].enabled && bank_[i].side == Side::below;
    }

    /// A unilateral guard on its surface that its reset does not turn back.
    [[nodiscard]] std::size_t stuck_member()
    {
        if (resets_.mode() != step_.mode() || !same_state(resets_.after(), step_.x0()))
            return no_guard;
        for (const std::size_t i : search_.members()) {
            if (bank_[i].info.unilateral) return i;
        }
        return no_guard;
    }

    // --- output ---

    void note_crossings(double s)
    {
        for (const std::size_t i : bank_.suspects()) {
            if (bank_[i].acting || !bank_.suspicious(i, step_.h())) continue;
            search_.note_crossings(step_, bank_, i, bank_.end(i, s), resolution_, calls());
        }
    }

    /// All that other guards do up to the set of the members: crossings before it, which
    /// leave a guard on its other side, and crossings with it.
    void note_crossings_to_set()
    {
        if (search_.members().size() == bank_.size()) return;
        for (const std::size_t i : bank_.suspects()) {
            GuardRecord& record = bank_[i];
            if (!bank_.suspicious(i, step_.h()) || is_member(i)) continue;
            const GuardSample at = search_.sample_at_set(step_, bank_, i, calls());
            const bool with_set = !record.info.boolean && at.s > record.from &&
                                  search_.crosses_with_set(step_, bank_, i, at, resolution_);
            GuardSample last = at;
            // On the side that it comes from, until it crosses.
            if (with_set) record.band = std::fabs(at.value);
            if (with_set) last.value = -std::copysign(std::numeric_limits<double>::min(), at.rate);
            if (!record.acting) {
                search_.note_crossings(step_, bank_, i, last, resolution_, calls());
            }
            if (has_left(record.side, last.value)) bank_.arm(i, opposite(record.side));
            const Side side = record.side;
            if (!with_set || side_of(last.value) != side) continue;
            if (!counts(side, record.info.crossing)) {
                bank_.arm(i, opposite(side));
            } else if (!record.acting) {
                if (counts_at_set(i)) {
                    search_.note_at_set(bank_, i, side, at.rate);
                } else {
                    bank_.arm(i, opposite(side));
                }
            }  // else its own event is still to come
        }
    }

    [[nodiscard]] bool counts_at_set(std::size_t i)
    {
        const bool enabled = system_.enabled_at(i, step_.mode(),
                                                     step_.time(search_.at()), search_.before());
        run_.statistics.disabled += !enabled;
        return enabled;
    }

    [[nodiscard]] bool is_member(std::size_t i) noexcept
    {
        auto& members = search_.members();
        return std::find(members.begin(), members.end(), i) != members.end();
    }

    void record(Event<X>&& event)
    {
        if (!options_.record_events) return;
        if (run_.events.empty()) run_.events.reserve(16);  // most runs grow no further
        run_.events.push_back(std::move(event));
    }

    void count_event(std::size_t i, double t, Side side)
    {
        GuardRecord& record = bank_[i];
        ++run_.statistics.events;
        ++record.events;
        record.last = t;
        record.last_side = side;
    }

    void record_time_event(double t)
    {
        stops_ = options_.stop_at_event;
        ++run_.statistics.events;
        record({.t = t,
                .kind = EventKind::time,
                .guard = no_guard,
                .mode_before = step_.mode(),
                .mode_after = resets_.mode(),
                .before = search_.before(),
                .after = resets_.after(),
                .bracket = {t, t},
                .slope = 0});
    }

    /// A member of the set, found inside the step or flipped at its start.
    void record_crossing(std::size_t i, double t, bool located)
    {
        stops_ = (stops_ && i != first_member()) || ends_run(i);
        count_event(i, t, bank_[i].side);
        if (!options_.record_events) return;
        const Location where = located ? search_.where(i) : Location{};
        record({.t = t,
                .kind = kind_of(where),
                .guard = i,
                .mode_before = step_.mode(),
                .mode_after = resets_.mode(),
                .before = search_.before(),
                .after = resets_.after(),
                .bracket = {step_.time(where.lo), step_.time(where.hi)},
                .slope = where.slope,
                .error = where.error,
                .late = located && search_.late()});
    }

    /// A notification of a guard that a reset has carried across its surface.
    void record_jump(std::size_t i, Side before)
    {
        const double t = step_.time(0);
        count_event(i, t, before);
        record({.t = t,
                .guard = i,
                .mode_before = step_.mode(),
                .mode_after = step_.mode(),
                .before = step_.x0(),
                .after = step_.x0(),
                .bracket = {t, t}});
    }

    /// What happened in the step up to offset s without consequence.
    void record_notes(double s)
    {
        if (search_.notes().empty()) return;
        search_.keep_notes_until(s);
        const double remainder = s == search_.at() ? search_.at_remainder() : 0;
        const double latest = step_.instant(s, remainder).value;
        for (const Note& note : search_.notes()) {
            const double t = backward_ ? std::max(step_.time(note.where.root), latest)
                                       : std::min(step_.time(note.where.root), latest);
            count_event(note.guard, t, note.side);
            if (!options_.record_events) continue;
            Event<X> event{.t = t,
                           .kind = note.kind,
                           .guard = note.guard,
                           .mode_before = step_.mode(),
                           .mode_after = step_.mode(),
                           .bracket = {step_.time(note.where.lo), step_.time(note.where.hi)},
                           .slope = note.where.slope,
                           .error = note.where.error};
            if (options_.event_states || system_->fixed_dimension) {
                event.before = search_.state_at(step_, note);
                event.after = event.before;
            }
            record(std::move(event));
        }
    }

    void record_step(double s)
    {
        if (options_.record_steps && s > 0) {
            run_.solution.add(step_.time(0), backward_, step_.mode(), step_.dense(), s);
        }
    }

    [[nodiscard]] bool lies_before(double t, double end) const noexcept
    {
        return backward_ ? t > end : t < end;
    }

    /// Samples of the current step before its offset s.
    void emit_samples(double s)
    {
        const auto& times = options_.sample_times;
        while (next_sample_ < times.size() && lies_before(times[next_sample_], step_.time(s))) {
            const double offset = std::min(step_.until(times[next_sample_]), s);
            X x = step_.x0();
            if (offset > 0) step_.sample(offset, x);
            add_sample(std::move(x));
        }
    }

    /// Samples of a state that does not move, before the time `until`.
    void emit_held_samples(double until)
    {
        const auto& times = options_.sample_times;
        while (next_sample_ < times.size() && lies_before(times[next_sample_], until)) {
            add_sample(X(step_.x0()));
        }
    }

    void add_sample(X&& x)
    {
        run_.trajectory.t.push_back(options_.sample_times[next_sample_]);
        run_.trajectory.x.push_back(std::move(x));
        sample_mode_ = step_.mode();
        ++next_sample_;
    }

    // --- saving ---

    template <class Visitor>
    void visit_state(Visitor&& visit)
    {
        if constexpr (std::remove_cvref_t<Visitor>::saves) place_ = step_.place();
        visit(place_.t.value);
        visit(place_.t.remainder);
        visit(place_.mode);
        for (X* x : {&place_.x, &place_.remainder, &place_.rate}) visit.state(*x);
        visit(h_next_);
        visit(first_step_);
        visit(flight_start_);
        visit(longest_step_);
        visit(time_event_);
        visit(resting_);
        visit(ended_);
        visit(run_.outcome);
        visit_samples(visit);
        if (guarded_) bank_.visit(visit);
        if (puts_off_) {
            visit(last_h_);
            visit(newly_armed_);
            planner_->visit(visit);
        }
    }

    /// The next sample is the first that is neither behind nor written already.
    template <class Visitor>
    void visit_samples(Visitor&& visit)
    {
        const auto& times = options_.sample_times;
        double written = next_sample_ > 0 ? times[next_sample_ - 1] : -infinity;
        if (backward_ && next_sample_ == 0) written = infinity;
        visit(written);
        if constexpr (!std::remove_cvref_t<Visitor>::saves) {
            next_sample_ = 0;
            while (next_sample_ < times.size() &&
                   (lies_before(times[next_sample_], place_.t.value) ||
                    !lies_before(written, times[next_sample_]))) {
                ++next_sample_;
            }
        }
    }

    static constexpr int most_levels = 100;
    static constexpr double stale = std::numeric_limits<double>::quiet_NaN();
    /// Of the last flight of a guard: over so long the rounding of its small excursions is
    /// magnified less by a difference quotient than over the usual 1e-5 of a step.
    static constexpr double low_part = 0.05;
    static constexpr ErrorRule rule_{};

    RunSetup<X> setup_;
    SystemAt<X> system_;
    Finders<X> finders_;
    bool error_controlled_;
    bool guarded_;     ///< has guards, if only none of them yet
    bool resets_any_;  ///< has resets
    bool timed_;
    bool puts_off_;
    bool predicts_;
    Options options_;
    Metering meter_;
    EventResolution resolution_;
    bool backward_;
    std::size_t components_;  ///< of the state at the start
    Step<X> step_;
    GuardBank<X, single> bank_;
    EventSearch<X, single> search_;
    std::optional<Planner<X, single>> planner_;
    double h_next_ = 0;
    double first_step_ = 0;    ///< [s]
    double flight_start_ = 0;  ///< [s] time of the last event
    double longest_step_ = 0;  ///< [s] after it
    double last_h_ = 0;        ///< [s] the step before, or the scale at which guards were armed
    bool newly_armed_ = true;  ///< all guards are sampled at the start of the step, none is planned
    bool watching_ = false;    ///< with their rates: every step is checked
    std::size_t careful_steps_ = 0;  ///< without looking ahead
    std::uint64_t next_review_ = 0;  ///< of the number of steps, against the options
    double reviewed_ = 0;            ///< [s] time of the last review
    double time_event_ = std::numeric_limits<double>::infinity();
    bool time_event_due_ = false;
    bool is_last_ = false;
    bool ended_ = false;
    bool resting_ = false;
    bool stops_ = false;
    bool calm_ = false;   ///< the last step held no event
    bool asked_ = false;  ///< a network, about the step in hand
    MergedResets<X> resets_;
    Mode mode_before_ = 0;
    std::size_t next_sample_ = 0;
    std::size_t shown_samples_ = 0;  ///< by `advance`
    std::uint64_t shown_events_ = 0;
    bool showing_sample_ = false;
    Mode sample_mode_ = 0;
    StepStart<X> place_;
    Run<X> run_;
};

}  // namespace ricochet::detail
