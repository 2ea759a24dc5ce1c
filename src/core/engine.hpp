// The events of a motion, computed here or by a host: which set comes first in a step, what its
// resets make of the state, and on which side every guard is armed afterwards.
//
//     find      the first set of events in the current step, and the state x⁻ there
//     apply     the resets of the fired guards: x⁻ becomes x⁺, the mode may change
//     settle    arm every guard with the flow at x⁺; guards that a reset has carried across their
//               surfaces are the next set, at the same instant
//     record    the events, and the evidence that a step holds none
//     rest      what accumulates comes to rest, and is held until the flow lifts it
//
// A loop has the engine as a member: `Loop` adds a method that takes the steps, `MonitorLoop` is
// shown the steps of a host. The engine owns the step and the run so far, with which both work.
#pragma once

#include <algorithm>
#include <boost/container/small_vector.hpp>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/cost_comparison.hpp"
#include "core/endless_sets.hpp"
#include "core/event_search.hpp"
#include "core/guard_life.hpp"
#include "core/guard_rounding.hpp"
#include "core/guard_table.hpp"
#include "core/held_components.hpp"
#include "core/merged_resets.hpp"
#include "core/planner.hpp"
#include "core/step.hpp"
#include "core/time_events.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/refusals.hpp"
#include "ricochet/options.hpp"
#include "ricochet/run.hpp"

namespace ricochet::detail {

/// How a loop uses the engine.
struct EngineUse {
    std::string_view who;        ///< name with which messages of refusal begin
    bool repeats_steps = false;  ///< steps may end before a window, to hold all of it
    bool cuts_at_all = false;    ///< guards without a reset cut the step, too
};

/// Converts to `false` as a compile-time constant.
struct Never {
    constexpr explicit Never(bool) noexcept {}
    constexpr operator bool() const noexcept { return false; }
};

template <class X, bool single>
class EventEngine {
public:
    static constexpr double infinity = std::numeric_limits<double>::infinity();

    /// Places the current step at the start. Keeps a reference to `setup`.
    /// @param options  options that have been validated
    EventEngine(const RunBindings<X>& setup, const X& x0, const Options& options,
                const EngineUse& use)
        : setup_(setup),
          span_(span_of(setup, options)),
          system_(*setup.system, setup.adapter, &span_),
          finders_{setup.detector, setup.detecting, setup.locator, setup.locating},
          error_controlled_(setup.error_controlled),
          guarded_(system_->guarded),
          phases_(system_->phases),
          own_guards_(phases_ ? phases_->own_guards(phases_->adapter) : no_guard),
          resets_any_(system_->resets()),
          timed_(system_->timed()),
          defers_(defers(setup.detector, *setup.system)),
          predicts_(setup.detector.clears != nullptr),
          options_(options),
          costs_(defers_ ? nullptr : setup.detector.metering),
          resolution_(options),
          cuts_at_all_(use.cuts_at_all),
          who_(use.who),
          backward_(options.t_end < options.t_start),
          step_(system_, *setup.kernel, x0, options),
          guards_(system_, GuardRules::of(setup.detector, system_), backward_),
          time_events_(system_, backward_, options.continues),
          resets_(x0),
          left_rate_(x0),
          left_start_(x0),
          sets_(x0),
          holds_(system_, step_, guards_, run_.statistics.guard_calls, backward_)
    {
        // A run in which nothing happens needs no search.
        if (guarded_ || timed_ || phases_) {
            search_.emplace(system_, x0, guards_.size(), finders_, options_);
        }
        const Screening screening = setup.detector.screening;
        guards_.await_series(
            step_, !defers_ && !predicts_ &&
                       (screening == Screening::extremum || screening == Screening::every));
        cuts_before_windows_ = !single && use.repeats_steps && options.event_window > 0 && !defers_;
        if (defers_) planner_.emplace(system_, finders_, x0, backward_, guards_.size());
    }

    EventEngine(const EventEngine&) = delete;  // its parts refer to each other
    EventEngine& operator=(const EventEngine&) = delete;

    // --- the run in progress, on which the loop works, too ---

    [[nodiscard]] Step<X>& step() noexcept { return step_; }
    [[nodiscard]] const Step<X>& step() const noexcept { return step_; }
    [[nodiscard]] Run<X>& run() noexcept { return run_; }
    [[nodiscard]] const Run<X>& run() const noexcept { return run_; }
    [[nodiscard]] Options& options() noexcept { return options_; }
    [[nodiscard]] const Options& options() const noexcept { return options_; }
    [[nodiscard]] const SystemAt<X>& system() const noexcept { return system_; }
    [[nodiscard]] const Finders<X>& finders() const noexcept { return finders_; }
    [[nodiscard]] const EventResolution& resolution() const noexcept { return resolution_; }
    [[nodiscard]] const GuardTable<X, single>& guards() const noexcept { return guards_; }
    [[nodiscard]] HeldComponents<X, single>& holds() noexcept { return holds_; }
    [[nodiscard]] const HeldComponents<X, single>& holds() const noexcept { return holds_; }
    [[nodiscard]] Planner<X, single>& planner() noexcept { return *planner_; }
    [[nodiscard]] const Planner<X, single>& planner() const noexcept { return *planner_; }
    [[nodiscard]] const NetworkCosts& costs() const noexcept
    {
        return defers_ ? planner_->costs() : costs_;
    }
    /// Approximate length [s] of the next step.
    [[nodiscard]] double& h_next() noexcept { return h_next_; }
    [[nodiscard]] double h_next() const noexcept { return h_next_; }
    /// Length [s] of the previous step, or the scale at which guards were armed.
    [[nodiscard]] double& last_h() noexcept { return last_h_; }

    /// What the current step ends at.
    struct End {
        bool time_event = false;
        bool change = false;  ///< that its stepper has located
    };
    [[nodiscard]] End& ends_at() noexcept { return ends_at_; }
    [[nodiscard]] const End& ends_at() const noexcept { return ends_at_; }

    /// All guards are sampled at the start of the step, none is planned.
    [[nodiscard]] bool newly_armed() const noexcept { return newly_armed_; }
    /// Rates are sampled, too, since every step is checked.
    [[nodiscard]] bool watching() const noexcept { return watching_; }
    [[nodiscard]] bool ended() const noexcept { return ended_; }
    /// Number of instants with events so far.
    [[nodiscard]] std::uint64_t instants() const noexcept { return sets_.instants(); }
    [[nodiscard]] bool is_after_time_event() const noexcept
    {
        return timed_ && time_events_.was_at(step_.start().value);
    }

    /// Names no guard of the phases as one that has ended the run.
    void hide_guards_of_phases() noexcept
    {
        if (is_of_phases(run_.guard)) run_.guard = no_guard;
        if (is_of_phases(run_.other_guard)) run_.other_guard = no_guard;
    }
    /// The mode of the system.
    [[nodiscard]] Mode shown(Mode mode) const noexcept { return phases_ ? own_mode(mode) : mode; }

    /// Number of modes; 0: not declared. A system without modes is always in mode 0.
    [[nodiscard]] std::size_t modes() const { return system_->moded ? system_.modes() : 1; }

    void refuse_bad_modes() const
    {
        const std::size_t modes = this->modes();
        if (modes > 0 && options_.mode >= modes) throw_unknown_mode(who_, options_.mode, modes);
    }

    void refuse_bad_guards();

    /// Whether something besides the end time and the resets may end the run; of resets that is not
    /// known in advance.
    [[nodiscard]] bool may_end() const noexcept;

    /// Time [s] of the next time event; infinity: there is none.
    [[nodiscard]] double time_event() const noexcept { return time_events_.next(); }

    void end(Outcome outcome, std::size_t guard = no_guard) noexcept
    {
        run_.outcome = outcome;
        run_.guard = guard;
        ended_ = true;
    }

    /// Ends the run since a function, "flow" or of guard i, was not finite.
    [[gnu::cold, gnu::noinline]] void end_not_finite(std::string_view function,
                                                     std::size_t i) noexcept
    {
        end(Outcome::non_finite, i);
        const bool has_guard = i < guards_.size();
        if (phases_ && phases_->name_of && is_of_phases(i)) {
            run_.reason = phases_->name_of(phases_->adapter, i);
            return;
        }
        run_.reason = reason_not_finite(
            function, i, has_guard ? std::string_view(guards_[i].info.name) : std::string_view());
    }

    /// Forgets what ended a run before.
    void forget_cause() noexcept
    {
        run_.guard = run_.other_guard = no_guard;
        run_.wrong_bound.reset();
        run_.reason.clear();
    }

    /// Lets the run go on that has ended.
    void reopen() noexcept
    {
        ended_ = false;
        run_.outcome = Outcome::reached_end;
    }

    // --- set-up ---

    /// Puts the guards that fire at the start into the fired set; if the run `begins` there, also
    /// those with `at_start`.
    void arm_at_start(bool begins);

    using After = typename TimeEvents<X>::After;

    /// Finds the next time event at the start of the step. Where that is lost, the run ends or is
    /// refused.
    void find_time_event(After what);

    /// Forgets the events of a run, before another one starts.
    void forget_run();
    /// Name with which messages of refusal begin.
    void speak_as(std::string_view who) noexcept { who_ = who; }
    /// Moves the end of the run to t_end [s]; infinity: it is endless, and its options end at the
    /// largest double.
    void end_at(double t_end)
    {
        endless_ = std::isinf(t_end);
        if (endless_) t_end = std::copysign(std::numeric_limits<double>::max(), t_end);
        options_.t_end = t_end;
        (backward_ ? span_.from : span_.to) = t_end;
        step_.renew_span();
    }
    [[nodiscard]] bool is_endless() const noexcept { return endless_; }

    // --- find ---

    /// Lets the detector examine the step as it does every step. False: it holds no event.
    /// @param cleared  whether a network has predicted that it holds none
    [[nodiscard]] bool deserves_search(bool& cleared);

    /// Whether any guard needs a search. For detectors that ask for it, guards are evaluated inside
    /// the step as well, and a second time if the first evaluation leaves doubts.
    [[nodiscard]] bool any_suspicious()
    {
        if (guards_.on_series() || !guards_.checks_inside() || !options_.check_inside)
            return guards_.suspicious(step_.h());
        if (step_.is_hosts_cubic() && guards_.clear_as_cubics(step_.h())) return false;
        check_inside();
        const bool signs = guards_.has_signs() && search_->checks_signs_closely(step_.h());
        return is_suspicious(signs || (error_controlled_ && hardly_moves()));
    }

    /// Whether any guard needs a search, after the evaluation inside the step, if there is one.
    /// `everywhere`: guards are evaluated at several more places, as where the state hardly moves.
    [[nodiscard]] bool is_suspicious(bool everywhere);

    /// Guards with power series need no rates until a search asks for them.
    void sample_end()
    {
        if (!on_series()) return guards_.sample_end(step_, calls());
        guards_.sample_values_at_end(step_, calls());
        guards_.see_series(step_);
        if (!guards_.on_series()) guards_.complete_rates(step_, calls());
    }

    void pass_on_clear() noexcept
    {
        run_.statistics.evidence.add(evidence_of_clear());
        guards_.pass_on();
    }

    /// Whether the end of the step is a time that is known before: that of a time event, or the end
    /// of the run.
    [[nodiscard]] bool ends_on_time() const noexcept
    {
        return ends_at_.time_event || step_.is_pinned();
    }
    /// Finds the first set that cuts the step short, and the state after its resets. False:
    /// the step stands, and the other events in it are recorded.
    /// @param before_resets  called before the resets of a set, which may change the flow
    template <class Before>
    [[nodiscard]] bool find(bool cleared, const Before& before_resets);
    [[nodiscard]] bool find(bool cleared)
    {
        return find(cleared, [] {});
    }

    /// Whether the step is to end before the window of a set, which the next one holds as a whole,
    /// and [s] where; 0: it stands.
    [[nodiscard]] double take_before_window() noexcept { return std::exchange(before_window_, 0); }
    [[nodiscard]] bool is_before_window() const noexcept { return before_window_ > 0; }

    /// A guard that acts or records, and the time until it reaches its surface at its present rate.
    struct Approach {
        std::size_t guard = no_guard;
        double ahead = infinity;  ///< [s]
    };
    /// The first guard to reach its surface in the direction that counts.
    [[nodiscard]] Approach first_approach();

    // --- quiet runs ---

    /// Whether guards are power series over each step.
    [[nodiscard]] bool on_series() const noexcept { return guards_.expects_series(); }
    [[gnu::always_inline]] void lend(QuietRun& quiet) const noexcept
    {
        quiet.checks_inside = guards_.checks_inside() && options_.check_inside && !on_series();
        guards_.lend(quiet, step_.time(0));
    }
    /// Takes the guard, the counts and the length of the next step over from a quiet run.
    [[gnu::always_inline]] void take_back(const QuietRun& quiet);

    // --- deferred checks ---

    void name_wrong_bound()
    {
        run_.wrong_bound = planner_->wrong();
        end(Outcome::wrong_bound, run_.wrong_bound->guard);
    }

    void count_deferred(std::size_t steps) noexcept
    {
        run_.statistics.checks_deferred += steps;
        add_evidence(finders_.detector.deferred, steps);
    }

    /// Samples all guards at the start of the current step, in which every guard is examined.
    void watch_all()
    {
        if (!watching_) guards_.wake_all(step_, last_h_, calls(), newly_armed_);
        watching_ = newly_armed_ = true;
        planner_->review(run_.statistics);
    }

    /// Plans the deadlines of guards that have just been armed.
    void begin_plan()
    {
        newly_armed_ = watching_ = false;
        planner_->begin(step_, guards_);
    }

    /// Whether one of the guards in doubt needs a search in the current step. Those that their
    /// bounds clear on a division of the step are not in doubt any more.
    [[nodiscard]] bool doubts_remain();

    /// As `Planner::close`, for the current step.
    [[nodiscard]] std::size_t close_interval()
    {
        return planner_->close(step_, guards_, run_.statistics, h_next_);
    }
    /// Tests a deferred guard, or the verified ones, or all at the end of the run; true: a bound is
    /// wrong, and the run has ended.
    [[nodiscard]] bool sample_sleeper()
    {
        planner_->sample_sleeper(step_, guards_, run_.statistics);
        return has_wrong_bound();
    }
    [[nodiscard]] bool settle_verified()
    {
        planner_->settle(step_, guards_, run_.statistics);
        return has_wrong_bound();
    }
    [[nodiscard]] bool check_last()
    {
        planner_->check_last(step_, guards_, run_.statistics);
        return has_wrong_bound();
    }
    [[nodiscard]] bool has_wrong_bound()
    {
        if (planner_->wrong()) name_wrong_bound();
        return ended_;
    }
    /// Finds the deadlines of guards again after an exception has left them half renewed.
    void plan_again()
    {
        if (!replans_) return;
        guards_.wake_all(step_, last_h_, calls(), newly_armed_);
        newly_armed_ = true;
        replans_ = false;
    }

    // --- apply ---

    /// Time [s] of the set that was found, the offset of it, and the state and mode before it.
    [[nodiscard]] double set_time() const noexcept { return on_time_ ? time_event() : set_time_; }
    [[nodiscard]] double set_offset() const noexcept { return search_->at(); }
    [[nodiscard]] const X& before() noexcept { return search_->before(); }
    [[nodiscard]] Mode mode_before() const noexcept { return mode_before_; }
    [[nodiscard]] bool is_on_time() const noexcept { return on_time_; }
    [[nodiscard]] std::span<const std::size_t> fired() noexcept { return search_->fired().span(); }
    /// Keeps what the samples before the set need of its search.
    void keep_lost() { search_->keep_lost(step_); }

    /// Applies the set that was found, which cuts the step short.
    void apply_found();

    /// Applies a time event at the start of the step.
    void apply_time_event() { apply_without_guards(true); }
    /// Applies what the accepted step has ended at. @param taken  as in `leave_from_start`
    void apply_at_end(double taken)
    {
        on_change_ = std::exchange(ends_at_.change, false);
        apply_without_guards(timed_ && ends_at_.time_event, taken);
    }
    /// Keeps the flow at the start of the step that is accepted next.
    void keep_flow_at_start() { assign(left_start_, step_.rate0()); }
    /// Fires guard i at the start of the step, or records its event there. False: nothing fires.
    [[nodiscard]] bool fire_here(std::size_t i);
    /// Goes on from here in another phase: not a start, so that guards keep their sides. `settle`
    /// is due.
    void change_phase(const X& x, Mode mode);

    // --- settle ---

    /// Work that is due once the flow at the start of the step is known.
    enum class Pending : std::uint8_t {
        nothing,
        settle,        ///< guards have fired: handle their accumulations, then arm all guards
        arm,           ///< a fired guard has come to rest: arm all guards
        arm_stuck,     ///< the same, for a guard that its reset did not turn back
        arm_released,  ///< components that a rest held go free: arm all guards
    };

    /// Arms the guards with the flow at x⁺. True: another set has been applied at the same
    /// instant, or a fired guard has come to rest, and `settle` is due again.
    [[nodiscard]] bool settle();

    /// Settles everything that happens at one instant, and evaluates the flow there.
    void settle_all()
    {
        sets_.begin_instant();
        while (settle()) {
        }
    }

    [[nodiscard]] Pending pending() const noexcept { return pending_; }
    void drop_pending() noexcept { pending_ = Pending::nothing; }
    void begin_instant() noexcept { sets_.begin_instant(); }

    // --- rest ---

    /// Releases hold k of what is held, with an event, at the start of the step.
    void release_here(std::size_t k);

    // --- record ---

    /// Whether events are recorded with their states.
    [[nodiscard]] bool records_states() const noexcept
    {
        return options_.record_events && (options_.event_states || system_->fixed_dimension);
    }

    /// Brings the counts up to date with those of the step, the search and the planner, and lists
    /// the guards that were armed beyond their surfaces.
    void bring_up_to_date();

    /// Takes back a recorded event of guard i.
    void forget_event(std::size_t i) noexcept { --guards_[i].events; }

    // --- snapshots ---

    /// State of the guards on which their future depends.
    template <class Visitor>
    void visit_guards(Visitor&& visit)
    {
        if (guarded_) guards_.visit(visit);
    }
    template <class Visitor>
    void visit_planner(Visitor&& visit)
    {
        if (!defers_) return;
        visit(last_h_);
        visit(newly_armed_);
        planner_->visit(visit);
    }
    template <class Visitor>
    void visit_time_event(Visitor&& visit)
    {
        time_events_.visit(visit);
    }
    template <class Visitor>
    void visit_ended(Visitor&& visit)
    {
        visit(ended_);
    }
    /// Goes on from a place that has been read together with the guards.
    void go_on_from(const StepStart<X>& place);
    /// See `Step::keep_before`.
    void keep_before(double last) noexcept { step_.keep_before(last); }

    /// What events change, as it is at the start of a step.
    struct Checkpoint {
        explicit Checkpoint(const EventEngine& engine) : guards(engine.guards_) {}

        GuardTable<X, single> guards;
        StepStart<X> start{};
        double last_h = 0, time_event = 0;
        bool watching = false;
        typename HeldComponents<X, single>::Kept holds{};
    };
    void keep(Checkpoint& at) const;
    void put_back(const Checkpoint& at);
    /// Forgets what was being done where an exception has come from.
    /// @param newly_armed  as it was at the start of the step
    /// @param planned      guards were left alone until their deadlines
    void forget_exception(bool newly_armed, bool planned);
    /// Events that were rejected in searches, and are not yet counted.
    [[nodiscard]] std::uint64_t disabled() const noexcept
    {
        return search_ ? search_->disabled : 0;
    }
    void set_disabled(std::uint64_t count) noexcept
    {
        if (search_) search_->disabled = count;
    }

private:
    [[nodiscard]] std::uint64_t& calls() noexcept { return run_.statistics.guard_calls; }

    [[nodiscard]] Evidence evidence_of_quiet() const noexcept
    {
        return on_series() ? Evidence::proved : finders_.detector.evidence;
    }
    void add_evidence(Evidence evidence, std::uint64_t steps) noexcept;

    // --- set-up ---

    /// The times at which functions may be called; a host may go on for ever.
    [[nodiscard]] static RunSpan<X> span_of(const RunBindings<X>& setup, const Options& options)
    {
        if (!setup.kernel->take) return {};
        return {.from = std::min(options.t_start, options.t_end),
                .to = std::max(options.t_start, options.t_end)};
    }

    // --- phases ---

    /// Whether guard i belongs to the phases, not to the system.
    [[nodiscard]] bool is_of_phases(std::size_t i) const noexcept
    {
        return i >= own_guards_ && i != no_guard && i != time_event_reset;
    }

    /// Lets the phases decide how the motion goes on after the resets of a set.
    [[gnu::noinline]] void decide(bool on_time, double t)
    {
        if (resets_.conflict().first != no_guard || shown(resets_.mode()) >= own_modes - 1) return;
        const PhaseSet<X> set{search_->fired().span(),
                              on_time,
                              std::exchange(on_change_, false),
                              t,
                              step_.mode(),
                              resets_.mode(),
                              search_->before()};
        resets_.move_to(phases_->decide(phases_->adapter, set, resets_.after()));
    }

    /// Records the changes of reactions at a set that no guard of the system stands for.
    [[gnu::noinline]] void record_changes(double t, bool located);
    /// The change of a reaction that is recorded under a guard of the system, or null.
    [[nodiscard, gnu::noinline]] const ReactionChange* change_under(std::size_t guard);

    /// Whether guard i, not in the fired set, is on its other side at the set by no more than
    /// rounding.
    [[nodiscard]] bool is_flipped_by_rounding(std::size_t i, Side before);

    /// Change of guard i at the start of the step that may come from rounding of the time and of
    /// the state, by 8 units in the last place of each component.
    [[nodiscard]] double rounding_of(std::size_t i)
    {
        return rounding_of(i, step_.mode(), step_.time(0), step_.x0());
    }
    [[nodiscard]] double rounding_of(std::size_t i, Mode mode, double t, const X& x)
    {
        return detail::rounding_of(guards_.view(i, mode, calls()), step_, t, x);
    }

    // --- time events ---

    /// Asks a timer in the state, which a set or a rest may have started or cancelled.
    void ask_timer()
    {
        if (system_->next_time_event_at && !ended_) find_time_event(After::set);
    }

    /// Applies a time event that is due at the start of the step, after others of this instant.
    [[nodiscard]] bool apply_due_time_event();

    /// Applies a set without guards at the start of the step: a time event, or a change that the
    /// stepper has located. `settle` deals with its consequences.
    /// @param taken  as in `leave_from_start`
    void apply_without_guards(bool on_time, double taken = 0)
    {
        begin_set();
        apply_at_start(on_time, taken);
    }
    /// Begins the first set of an instant.
    void begin_set() noexcept
    {
        guards_.take_tolerances();
        first_set_ = true;
    }
    /// Applies a time event, or a change located by the stepper, after other sets of the same
    /// instant: guards keep their event tolerances.
    void apply_at_start(bool on_time, double taken = 0);

    /// After a time event the flow is that of the double after it, where it jumps there.
    void start_beyond_time_event()
    {
        if (timed_ && time_events_.was_at(step_.start().value)) step_.start_beyond(options_.t_end);
    }

    // --- finding ---

    void check_inside();

    /// Whether the state hardly changes in the step: error control then does not limit the step.
    [[nodiscard]] bool hardly_moves() const noexcept;

    /// Whether the network predicts that the step is free of events.
    [[nodiscard]] bool ask_network();

    [[nodiscard]] Evidence evidence_of_clear() const noexcept
    {
        return guards_.on_series() ? Evidence::proved : finders_.detector.evidence;
    }

    // --- ties ---

    /// Whether guard i is so near to its surface at the end of the step that rounding may decide
    /// whether it has crossed.
    [[nodiscard]] bool may_tie(std::size_t i) const noexcept;
    /// The rate of guard i, if it crosses its surface at the end of the step within rounding: its
    /// parabola crosses within 4 units in the last place of the time, or within the rounding of its
    /// value over its rate, and its rate is more than rounding. Else 0; a touch does not tie.
    [[nodiscard]] double rate_of_tie(std::size_t i);
    [[nodiscard]] bool has_ties();
    /// Joins guards that tie with the end of the step to a set there: to the set that has been
    /// `found`, if it lies there, or to a new one. False: there are none.
    [[nodiscard]] bool add_ties(bool found);
    /// Records the crossings of recorded guards that tie with a time event.
    void note_ties();

    /// Whether the window of the set that was found reaches beyond the step, and a step that begins
    /// shortly before the set would hold all of it: `before_window_` is the offset of that place.
    [[nodiscard, gnu::noinline]] bool ends_inside_window();

    void count_refined() noexcept
    {
        run_.statistics.refined_steps += search_->refined();
        run_.statistics.unresolved_steps += search_->unresolved();
    }

    /// Counts divided steps as `count_refined` does, for a step that holds no event.
    void count_covered() noexcept
    {
        run_.statistics.bound_calls += search_->cover().take_enclosed();
        run_.statistics.refined_steps += search_->cover().refined();
        run_.statistics.unresolved_steps += search_->cover().unresolved();
    }

    [[gnu::noinline]] void end_plateaus()
    {
        for (std::size_t i = 0; i < guards_.size(); ++i) {
            if (guards_.leaves_plateau(i)) search_->end_plateau(step_, guards_, i, calls());
        }
    }

    [[nodiscard]] double approach_rate(std::size_t i);

    /// Whether an event of guard i, which is about to fire at the start of the step, counts.
    [[nodiscard]] bool counts_here(std::size_t i);
    [[nodiscard]] bool is_enabled_here(std::size_t i) const
    {
        return system_.enabled_at(i, step_.mode(), step_.time(0), step_.x0());
    }

    /// Removes guards from the fired set whose crossing is no event: those that `enabled`
    /// rejects, and repeats of an event inside its own window.
    void dismiss_members();

    /// Whether a crossing repeats the last event of the guard in the same direction. If the guard
    /// has not turned back since, it is the same crossing, found again because the reset moved the
    /// state by its rounding; otherwise it is a new event, and events accumulate. A guard that has
    /// been on its other side in between repeats nothing, unless the two cannot be told apart.
    [[nodiscard]] bool repeats(std::size_t i, double t) const noexcept
    {
        const GuardRecord& record = guards_[i];
        const double reach = record.last.returned ? resolution_.blur(t) : resolution_.window(t);
        return record.side == record.last.side && std::fabs(t - record.last.t) <= reach;
    }

    [[nodiscard]] bool turned_back(std::size_t i) const noexcept
    {
        return resets_any_ && guards_[i].info.resets && guards_[i].departure.turned;
    }

    /// Whether a guard of a set still has its event where another reset has been applied first.
    struct Stands {
        EventEngine& engine;
        double t;
        bool located;

        [[nodiscard]] bool knows_flow() const noexcept { return engine.system_->flow; }
        /// Guards that fire at the start of a step have been armed beyond.
        [[nodiscard]] Crossing direction(std::size_t i) const noexcept
        {
            const GuardRecord& record = std::as_const(engine.guards_)[i];
            if (record.info.crossing != Crossing::either) return record.info.crossing;
            const Side left = located ? record.side : opposite(record.side);
            return left == Side::below ? Crossing::rising : Crossing::falling;
        }
        [[nodiscard]] bool enabled(std::size_t i, Mode mode) const
        {
            return engine.system_.enabled_in(i, mode);
        }
        [[nodiscard]] bool moves(std::size_t i, Mode mode, const X& x) const
        {
            return engine.still_moves(i, mode, *this, x);
        }
    };

    /// Applies the resets of the fired guards to the state before.
    /// @param located  the guards have fired inside the step, not at its start
    void transform(bool on_time, bool located)
    {
        const double t = on_time ? time_event() : time_of_set();
        resets_.apply(system_, guards_, {search_->fired().span(), on_time, step_.mode(), t},
                      search_->before(), Stands{*this, t, located});
        if (phases_) decide(on_time, t);
    }

    /// Whether guard i moves along the flow of a mode at x in the direction of its event. Nothing
    /// is known of a guard that jumps.
    [[nodiscard]] bool still_moves(std::size_t i, Mode mode, const Stands& at, const X& x)
    {
        if (!at.knows_flow() || guards_[i].info.boolean) return true;
        if (at.located && search_->where(i).jump) return true;
        X rate = x;
        step_.flow_in(mode, at.t, x, rate);
        const Side left = at.located ? guards_[i].side : opposite(guards_[i].side);
        return sign_of(left) * guards_.view(i, mode, calls()).rate(at.t, x, rate, step_.h()) < 0;
    }

    /// Whether the event changes nothing, and no host asks for such cuts, so that the step can
    /// stand.
    [[nodiscard]] bool changes_nothing();

    /// Whether a reset that left the state and the mode alone has changed the flow or a guard, for
    /// example by a variable outside of the system. It has if one of them, evaluated again at the
    /// end of the step with the same arguments, has other bits than before.
    [[nodiscard]] bool changed_elsewhere();

    /// Whether a reset that has declined, in a system with modes, acts where the guard is strictly
    /// beyond its surface. One that does not is counted.
    [[nodiscard]] bool acts_beyond();

    /// Whether this event of the guard, not yet counted, ends the run.
    [[nodiscard]] bool ends_run(std::size_t i) const noexcept;

    void go_on_past_members();

    // --- deferred checks ---

    /// Whether declared bounds show an event inside the current step, where every guard is
    /// examined.
    [[nodiscard]] bool bounds_show_event();

    // --- applying ---

    /// Fires the set: places the step at the state after the resets, and records the events. Unless
    /// the run has ended, `settle` is due.
    /// @param located  inside the current step, else at its start
    /// @param on_time  with a time event
    void apply(bool located, bool on_time);

    /// Notes the remainders, which rounding has taken from the state, of the components that the
    /// resets of the set leave the same bit for bit: they belong to the state after the event, too.
    void note_left_alone(bool located);
    [[gnu::noinline]] void note_lost(const X& before, const X& after, bool located);

    void place_set(const Instant& at) noexcept
    {
        set_time_ = at.value;
        set_remainder_ = at.remainder;
    }

    /// Distance from its surface that a guard that has just fired may have. A guard with declared
    /// bounds may be expensive, and the distance is then taken from its location.
    void find_tolerance(std::size_t i, double t);

    /// Value |g| at the set, at time t, before its resets.
    [[nodiscard]] double value_at_set(std::size_t i, double t)
    {
        return std::fabs(guards_.view(i, step_.mode(), calls()).value(t, search_->before()));
    }

    [[nodiscard]] double time_of_set() const noexcept { return set_time_; }

    [[nodiscard]] std::size_t first_fired()
    {
        return search_->fired().empty() ? no_guard : search_->fired()[0];
    }

    /// Notes that a reset of the set has ended the run.
    void note_stop();

    /// Whether the resets have left a state to continue from; else the run has ended.
    [[nodiscard]] bool goes_on();

    [[nodiscard]] bool fits_dimension(const X& before, const X& after, bool same_mode) const
    {
        return after.size() > 0 && system_.fits_dimension(before, after, same_mode);
    }

    // --- settling ---

    /// Fires the guards that were carried across their surfaces, at the start of a run together
    /// with a time event that is due there.
    [[nodiscard]] bool apply_next_set(bool on_time = false);

    /// The guard that shows the sets at this instant to be without an end: the set, mode and state
    /// repeat, or it fires for the thousandth time; `no_guard` if there is none.
    [[nodiscard]] std::size_t endless_guard();

    /// Whether the events of a fired guard accumulate here, so that it comes to rest or the run
    /// ends.
    [[nodiscard]] bool rest_fired();
    /// Whether guard i, which fires once more at an instant, was carried away from its surface in
    /// between: it may do so up to a thousand times.
    [[nodiscard]] bool comes_from_afar(std::size_t i);

    /// Whether the fired guards prolong a row of events with excursions that are lost in rounding,
    /// by which a cycle of guards accumulates.
    [[nodiscard]] bool prolongs_row();
    /// As `prolongs_row`, for guards that fire at the instant of the set before, where rounding
    /// hides that they would have moved away from their surfaces and back.
    [[nodiscard]] bool prolongs_row_at_instant();
    /// Records the excursion of guard i that has just ended, `soon` after the last acting instant.
    /// True if the excursion is lost in rounding or has fallen to a thousandth; false if not
    /// `soon`.
    [[nodiscard]] bool falls(std::size_t i, bool soon);
    [[nodiscard]] bool has_excursions(std::size_t i) const noexcept
    {
        const GuardInfo& info = std::as_const(guards_)[i].info;
        return !info.boolean && resets_any_ && info.resets;
    }
    /// Notes the slopes and roundings that `falls` needs.
    void note_excursions();
    /// Size of an excursion that ended at a rate of `slope` [1/s], `interval` [s] after the last
    /// acting instant.
    [[nodiscard]] double size_of_excursion(std::size_t i, double slope,
                                           double interval) const noexcept;

    /// Uncertainty [s] of a limit that comes from the rounding of the guards of the cycle: those
    /// with an event in the last two rounds, each of length `round` [s].
    [[nodiscard]] double error_by_rounding(double round);
    /// Another guard of the cycle in which guard i accumulates: the last one before it.
    [[nodiscard]] std::size_t other_of_cycle(std::size_t i);

    /// The guard whose rest is asked where events of guard i accumulate: i, else the other one of
    /// its cycle, else `no_guard`.
    [[nodiscard]] std::size_t resting_of_cycle(std::size_t i);

    /// Stores the rate at which guard i leaves its surface after its reset. True if the guard will
    /// not rise above its rounding any more.
    [[nodiscard]] bool fades(std::size_t i);

    /// Rate of guard i after the motion has gone on for `ahead` [s], by a step of order `order`,
    /// one or two: with two the third derivative of a guard of the position enters.
    /// @param scale  of differences, as in `SystemTable::rate`
    [[nodiscard]] double rate_ahead(std::size_t i, double ahead, double scale, int order = 1);

    /// How far from its surface the reset has put guard i, positive on the side that it came from.
    [[nodiscard]] double distance_put_back(std::size_t i);

    /// The rate [1/s] of guard i at the start of the step; a difference quotient, if it has to
    /// be one, is taken over 1e-5 of `scale` [s].
    [[nodiscard]] double departure(std::size_t i, double scale)
    {
        return guards_.view(i, step_.mode(), calls())
            .rate(step_.time(0), step_.x0(), step_.rate0(), scale);
    }

    /// Brings guard i to rest: its events accumulate `ahead` [s] from here, known to `error` [s].
    void come_to_rest(std::size_t i, double ahead, double error);

    // --- what a rest holds ---

    /// The time [s] over which a motion at rest is reviewed: to the next time event or the end, or
    /// over a million steps.
    [[nodiscard]] double span_of_rest() const noexcept
    {
        const double end = timed_ ? std::min(step_.until(time_event()), step_.until(options_.t_end))
                                  : step_.until(options_.t_end);
        return std::isfinite(end) && !endless_ && !step_.is_of_host() ? end : 1e6 * h_next_;
    }
    /// Releases, with an event, the first hold whose guard the flow lifts at the start of the step.
    /// False: there is none.
    [[nodiscard]] bool release_lifted();

    /// Arms every guard after a rest, with what it holds.
    void arm_after_rest();

    void enable_guards();

    /// Whether the event of a guard armed on `side` cannot come before it has returned: it is
    /// beyond its surface.
    [[nodiscard]] static constexpr bool is_beyond(Side side, Crossing crossing) noexcept
    {
        return side != Side::plateau && !counts(side, crossing);
    }

    /// Arms guard i at the start of a run, where it may have an event.
    void arm_one_at_start(std::size_t i, bool begins);

    /// Puts guard i into the next set or, if it is only recorded, records its event.
    /// @param from  the side that it has left
    void have_event(std::size_t i, life::Arming arming, Side from);

    /// Fires guard i because its condition holds, not because of a crossing.
    void fire_by_condition(std::size_t i);

    /// Whether guard i, just armed in a mode that has been entered, asks to fire there.
    [[nodiscard]] bool fires_at_entry(std::size_t i) noexcept;

    void count_armed_beyond(std::size_t i, bool on_surface) noexcept
    {
        ++run_.statistics.armed_beyond;
        guards_[i].armed_beyond = true;
        guards_[i].armed_on = on_surface;
    }

    /// Whether guard i has an event recorded at t.
    [[nodiscard]] bool has_event_at(std::size_t i, double t) const;
    /// Removes from the count of guards armed beyond their surfaces those that are not there any
    /// more.
    void forget_armed_beyond();

    /// Counts guard i as armed beyond its surface if it stood there at the start, by rounding, and
    /// has left without an event.
    void note_left_start(std::size_t i);

    /// Arms every guard at the start of a flight. Guards that have fired count as
    /// being on their surface up to the error of their location. Guards that the
    /// resets have carried across their surface become the new fired set.
    void arm_all();

    /// Returns false if the run has ended.
    /// @param widest  largest error among the guards of the set
    /// @param opens   `ends_veto`
    [[nodiscard]] bool arm_one(std::size_t i, double widest, bool opens);

    /// What is seen of a guard where it is armed.
    struct Seen {
        Side side = Side::plateau;  ///< on which it lies, or to which it heads from its surface
        bool on = false;            ///< it is on its surface
        bool set_off = false;       ///< `leaves_here`
    };
    [[nodiscard]] Seen see(std::size_t i, Side before, double widest, bool opens);
    [[nodiscard]] bool is_now_set_off(std::size_t i, Side head)
    {
        return counts(opposite(head), std::as_const(guards_)[i].info.crossing) &&
               leaves_here(i, head);
    }
    [[nodiscard]] unsigned facts_of(const GuardRecord& record, Side from,
                                    const Seen& seen) const noexcept
    {
        return life::declared_of(record.info, resets_any_ && record.info.resets) |
               life::seen_of(from, seen.side, seen.on, record.info.crossing) |
               (seen.set_off ? life::is_set_off : 0u);
    }
    /// Whether a time event has ended the veto of guard i, which lies on its surface: a guard that
    /// was passed is armed beyond.
    [[nodiscard]] bool ends_veto(std::size_t i);

    /// Whether guard i, on its surface at x⁻ and at x⁺ and about to enter `side`, has its event
    /// here: the set has changed the mode (or a sign in the state that the guard reads, if it
    /// belongs to the set; or `is_set_in_motion`), and along the flow that was left it did not move
    /// that way. A crossing that merely goes on in another mode is the same event.
    [[nodiscard]] bool leaves_here(std::size_t i, Side side);
    /// Whether the set may have set guard i in motion, without a change of mode: a time event has
    /// changed the state or the flow, or the resets of other guards have, and guard i stood on its
    /// surface since the start or its last event.
    [[nodiscard]] bool is_set_in_motion(std::size_t i);
    /// Whether guard i, which is only recorded, has had an event that would have belonged to the
    /// current set if it had acted.
    [[nodiscard]] bool is_recorded_with_set(std::size_t i) const noexcept
    {
        const GuardRecord& record = std::as_const(guards_)[i];
        if (record.acting) return false;
        if (!first_set_) return !on_time_ && record.last.recorded_in + 1 == armings_;
        const double t = step_.time(0);
        return std::fabs(t - record.last.t) <= resolution_.blur(t);
    }
    /// Whether guard i stands on its surface, and no side is known from which it came.
    [[nodiscard]] bool stands(std::size_t i) const noexcept
    {
        const GuardRecord& record = std::as_const(guards_)[i];
        return record.enabled && record.side == Side::plateau && record.awaited == Side::plateau;
    }
    /// Whether any guard stands on its surface without a known side; the reset of another guard may
    /// set it in motion.
    [[nodiscard]] bool any_stands() const noexcept
    {
        if (single || !guards_.any_stands()) return false;
        for (std::size_t i = 0; i < guards_.size(); ++i) {
            if (stands(i)) return true;
        }
        return false;
    }
    /// Notes that the current set leaves the flow at the start of the step. The flow in
    /// `left_start_`, if it is known, is that of `taken` [s] before; 0: it is not known.
    void leave_from_start(double taken)
    {
        assign(left_rate_, step_.rate0());
        left_known_ = true;
        left_after_ = taken;
    }
    /// The same for a set with a time event, at the end of the step.
    void leave_from_end()
    {
        assign(left_start_, step_.rate0());
        assign(left_rate_, step_.rate1());
        left_known_ = true;
        left_after_ = step_.h();
    }
    /// Whether guard i is so near to its surface at x⁻ and x⁺ that only rounding tells its side.
    [[nodiscard]] bool stays_within_rounding(std::size_t i);
    /// Whether guard i is as near to its surface at the start of the step as rounding moves it.
    [[nodiscard]] bool lies_within_rounding(std::size_t i);

    /// Side that a guard on its surface is about to enter.
    [[nodiscard]] Side heading(std::size_t i);

    /// Whether the rest rule has failed to stop a motion into the surface.
    [[nodiscard]] bool still_stuck(std::size_t i) const noexcept
    {
        return guards_[i].info.unilateral && guards_[i].enabled && guards_[i].side == Side::below;
    }

    /// The first unilateral guard that fired, if the resets have changed nothing; else `no_guard`.
    [[nodiscard]] std::size_t stuck_guard();

    // --- recording ---

    void note_crossings(double s);

    /// Notes all that has to be known of the mode and the flow before the resets of the set, which
    /// may leave them.
    void note_set();
    /// `keep_suspects` stores what `note_set` changes besides the guards of the set, and
    /// `put_suspects_back` restores it where the resets have changed nothing.
    void keep_suspects();
    void put_suspects_back();
    /// Notes the guards whose events a time event finds vetoed.
    void note_vetoes();

    /// Records the crossings of other guards before the fired set that leave a guard on its other
    /// side, and the crossings that coincide with the set.
    void note_crossings_to_set();

    /// Time [s] of an event found up to offset s.
    [[nodiscard]] double time_of(const Note& note, double s) const noexcept;
    /// Drops the touches up to offset s that `enabled` rejects.
    void veto_touches(double s);

    [[nodiscard]] bool counts_at_set(std::size_t i);
    /// Whether a recorded guard has not left its side at the set, by no more than the rounding of
    /// its value there.
    [[nodiscard]] bool is_rounding_at_set(std::size_t i, const GuardSample& at);

    [[nodiscard]] bool is_member(std::size_t i) noexcept
    {
        auto& fired = search_->fired();
        return std::find(fired.begin(), fired.end(), i) != fired.end();
    }

    void record(Event<X>&& event)
    {
        if (!options_.record_events) return;
        event.mode_before = shown(event.mode_before);
        event.mode_after = shown(event.mode_after);
        if (setup_.add_event) return setup_.add_event(setup_.events, event);
        make_room(run_.events);
        run_.events.push_back(std::move(event));
    }

    void count_event(std::size_t i, double t, Side side);

    void record_time_event(double t);

    /// Bracket [s] of a guard whose event is at t.
    [[nodiscard]] Bracket bracket_of(const Location& where, double t) const noexcept;
    /// Records a fired guard that was found inside the step or carried across at its start.
    void record_crossing(std::size_t i, double t, bool located);

    /// Records a guard without effect that a reset has carried across its surface.
    void record_jump(std::size_t i, Side before);

    /// Writes the state at a crossing at time t, found up to offset s, into x.
    void assign_state_of(const Note& note, double s, double t, X& x);

    /// Records the events up to offset s that change nothing.
    void record_notes(double s);

    static constexpr double stale = std::numeric_limits<double>::quiet_NaN();
    /// Fraction of the last flight of a guard over which a difference quotient is taken: over this
    /// length the rounding of its small excursions is magnified less than over the usual 1e-5 of a
    /// step.
    static constexpr double low_part = 0.05;

    const RunBindings<X>& setup_;
    RunSpan<X> span_;
    SystemAt<X> system_;
    Finders<X> finders_;
    bool error_controlled_;
    bool guarded_;  ///< has guards, even if their number is zero so far
    const PhaseTable<X>* phases_;
    std::size_t own_guards_;  ///< number of guards of the system, without those of the phases
    bool resets_any_;         ///< has resets
    bool timed_;
    std::conditional_t<single, Never, bool> defers_;  ///< only the loop of any number plans
    bool predicts_;
    Options options_;
    NetworkCosts costs_;
    EventResolution resolution_;
    bool cuts_at_all_;
    std::string_view who_;
    bool backward_;
    Step<X> step_;
    GuardTable<X, single> guards_;
    std::optional<EventSearch<X, single>> search_;  ///< none where nothing can happen
    std::optional<Planner<X, single>> planner_;
    double h_next_ = 0;        ///< [s] approximate length of the next step
    double last_h_ = 0;        ///< [s] the previous step, or the scale at which guards were armed
    bool newly_armed_ = true;  ///< all guards are sampled at the start of the step, none is planned
    bool watching_ = false;    ///< rates are sampled too, since every step is checked
    bool replans_ = false;     ///< all deadlines of guards have to be found again
    End ends_at_;
    bool on_change_ = false;    ///< the current set lies there
    bool cuts_before_windows_;  ///< `EngineUse::repeats_steps`, and there are windows
    double before_window_ = 0;  ///< [s] where the current step should; 0: it stands
    TimeEvents<X> time_events_;
    TimesAtInstant timer_;  ///< of a timer in the state
    bool ended_ = false;
    bool endless_ = false;  ///< the end of the options is infinite
    bool stops_ = false;
    std::size_t stopper_ = no_guard;  ///< the guard of the set that ends the run
    bool asked_ = false;              ///< the network has been asked about the current step
    MergedResets<X> resets_;
    /// Time [s] of the current set. Time and remainder are kept apart in memory: a copy of both as
    /// a pair, right after each has been written by itself, would stall the processor.
    double set_time_ = 0;
    Mode mode_before_ = 0;
    struct {
        std::vector<typename GuardTable<X, single>::Kept> guards;
        std::vector<Note> notes;
        std::uint64_t disabled = 0, disabled_in_search = 0;
        bool uses_space = false;  ///< of the search
    } kept_;                      ///< see `keep_suspects`
    boost::container::small_vector<std::pair<std::size_t, double>, 8> left_alone_;
    bool changed_mode_ = false;  ///< by the resets of the current set
    bool enters_mode_ = false;   ///< by them, or by the rest after them
    X left_rate_;                ///< flow at x⁻, of the mode that is left
    X left_start_;               ///< the same at the start of the step
    double left_after_ = 0;      ///< [s] later; 0: it is not known
    bool left_known_ = false;
    bool leaves_phase_ = false;  ///< `search_` still holds x⁻, which resets have left
    bool located_ = false;       ///< the current set lies inside the step, not at its start
    double began_at_ = 0;     ///< [s] where guards were armed for the first time, or by a restart
    bool first_set_ = false;  ///< it is the first of its instant
    std::uint64_t armings_ = 0;  ///< number of times that all guards have been armed
    bool on_time_ = false;       ///< the current set coincides with a time event
    Pending pending_ = Pending::nothing;
    std::size_t stuck_ = no_guard;
    double set_remainder_ = 0;
    EndlessSets<X> sets_;
    Run<X> run_;
    HeldComponents<X, single> holds_;
};

}  // namespace ricochet::detail
